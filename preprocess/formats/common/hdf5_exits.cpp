#include "preprocess/formats/common/hdf5_exits.h"

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

class ExitFinder {
 public:
  explicit ExitFinder(const std::filesystem::path& path) : path_(path) {
    const QuietHdf5 quiet;
    const Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
    auto root = std::make_shared<const Hdf5Object>(file ? H5Oopen(file.id(), "/", H5P_DEFAULT) : -1);
    if (!*root) return;
    std::vector<HardLink> found{{std::move(root), "."}};
    while (!found.empty()) {
      const HardLink next = std::move(found.back());
      found.pop_back();
      const auto object =
          std::make_shared<const Hdf5Object>(H5Oopen(next.group->id(), next.name.c_str(), H5P_DEFAULT));
      H5O_info_t info;
      // What cannot be opened here cannot be opened by a reader.
      if (!*object || H5Oget_info2(object->id(), &info, H5O_INFO_BASIC) < 0) continue;
      if (info.rc > 1 && !several_names_.insert(info.addr).second) continue;
      if (info.type == H5O_TYPE_DATASET) lookAt(*object);
      if (info.type != H5O_TYPE_GROUP) continue;
      for (std::string& name : linksOf(*object)) found.push_back({object, std::move(name)});
    }
  }

  const Hdf5Exits& exits() const { return exits_; }

 private:
  struct HardLink {
    std::shared_ptr<const Hdf5Object> group;
    std::string name;
  };
  struct Link {
    std::string name;
    H5L_type_t type;
    size_t bytes;
  };

  [[noreturn]] void fail(const Hdf5Object& object, std::string_view what) const {
    std::array<char, 1024> name{};
    H5Iget_name(object.id(), name.data(), name.size());
    throw Error("{}: {}: {}", path_.string(), name.data(), what);
  }

  /// Looks at the external links of a group, and returns the names of the hard ones. Soft links stay in the
  /// file.
  std::vector<std::string> linksOf(const Hdf5Object& group) {
    std::vector<Link> links;
    const auto add = [](hid_t, const char* name, const H5L_info_t* info, void* to) -> herr_t {
      try {
        const bool has_value = info->type != H5L_TYPE_HARD;
        static_cast<std::vector<Link>*>(to)->push_back({name, info->type, has_value ? info->u.val_size : 0});
        return 0;
      } catch (const std::exception&) {
        return -1;
      }
    };
    if (H5Literate(group.id(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, add, &links) < 0)
      fail(group, "its list of objects cannot be read (HDF5: " + hdf5Reason() +
                      "); the file is damaged: copy or write it again");
    std::vector<std::string> names;
    for (Link& link : links) {
      if (link.type == H5L_TYPE_HARD) names.push_back(std::move(link.name));
      if (link.type != H5L_TYPE_EXTERNAL) continue;
      std::vector<char> value(link.bytes);
      const char *file = nullptr, *object = nullptr;
      if (H5Lget_val(group.id(), link.name.c_str(), value.data(), value.size(), H5P_DEFAULT) < 0 ||
          H5Lunpack_elink_val(value.data(), value.size(), nullptr, &file, &object) < 0)
        fail(group,
             "its link '" + link.name + "' cannot be read; the file is damaged: copy or write it again");
      follow(group, file);
    }
    return names;
  }

  void lookAt(const Hdf5Object& set) {
    const Hdf5Properties properties(H5Dget_create_plist(set.id()));
    if (!properties) return;
    if (H5Pget_external_count(properties.id()) > 0)
      fail(set, "its values are in another file, without a description; store them in this one");
    size_t count = 0;
    if (!isVirtual(properties)) return;
    if (H5Pget_virtual_count(properties.id(), &count) < 0) fail(set, "its sources cannot be read");
    for (size_t n = 0; n < count; ++n) {
      const std::string file = textOf(H5Pget_virtual_filename, properties, n),
                        source = textOf(H5Pget_virtual_dsetname, properties, n);
      if (file.find('%') != std::string::npos || source.find('%') != std::string::npos)
        fail(set,
             "its sources are named by the pattern '" + file + "', which is not followed; name each of them");
      if (file == ".")
        exits_.sources.push_back({path_, source});
      else if (const auto found = follow(set, file))
        exits_.sources.push_back({*found, source});
      else  // HDF5 would give its fill value
        fail(set, "takes values from " + file + ", which is not found; put it beside this file");
    }
  }

  template <typename Get>
  static std::string textOf(const Get& get, const Hdf5Properties& properties, size_t n) {
    const ssize_t size = get(properties.id(), n, nullptr, 0);
    std::string text(static_cast<size_t>(std::max<ssize_t>(0, size)) + 1, '\0');
    get(properties.id(), n, text.data(), text.size());
    text.pop_back();
    return text;
  }

  /// The file that HDF5 finds by this name, if there is one: beside this file, in the working directory or at
  /// the end of symbolic links. It looks for absolute names of missing files in these places, too.
  std::optional<std::filesystem::path> follow(const Hdf5Object& from, const std::filesystem::path& named) {
    const std::filesystem::path folder = folderOf(path_);
    std::error_code missing;
    std::filesystem::path name = named;
    if (named.is_absolute() && !std::filesystem::exists(named, missing)) name = named.filename();
    for (const auto& place : {folder, std::filesystem::path(), folderOf(linkTarget(path_))}) {
      const std::filesystem::path file = place / name;
      if (!std::filesystem::exists(file, missing)) continue;
      if (leadsOut(folder, name))
        fail(from,
             "leads to " + name.string() + ", which lies outside the folder of the file; put both into one");
      if (!isRegularFile(file)) fail(from, "leads to " + file.string() + ", which is not a regular file");
      exits_.files.insert(file);
      return file;
    }
    return std::nullopt;
  }

  const std::filesystem::path path_;
  std::set<haddr_t> several_names_;  // objects that were met, of those that have more than one
  Hdf5Exits exits_;
};

}  // namespace

Hdf5Exits exitsOf(const std::filesystem::path& path) {
  return ExitFinder(path).exits();
}

void requireStored(const std::filesystem::path& path, const std::vector<Hdf5Exits::VirtualSource>& sources) {
  const QuietHdf5 quiet;
  for (const auto& source : sources) {
    const Hdf5File file(H5Fopen(source.file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
    const Hdf5Object set(file ? H5Oopen(file.id(), source.set.c_str(), H5P_DEFAULT) : -1);
    if (!set)  // HDF5 would give its fill value
      throw Error("{}: takes virtual data from {} in {}, which cannot be opened{}", path.string(), source.set,
                  source.file.string(), file ? ": there is no such data set" : "");
    const Hdf5Properties properties(set ? H5Dget_create_plist(set.id()) : -1);
    if (properties && isVirtual(properties))
      throw Error(
          "{}: takes virtual data from {} in {}, which is a virtual data set itself; store its values in the "
          "file",
          path.string(), source.set, source.file.string());
  }
}

}  // namespace curvisplat
