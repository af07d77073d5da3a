// VTKHDF and Fluent: HDF5 files that HDF5 itself writes, whole and sound, with objects of any name, type and extent. Damaged structures of
// HDF5 are tried in a process of their own (library_trial.h), and by tests of the whole program.
#include <hdf5.h>

#include <algorithm>
#include <string>
#include <vector>

#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/fluent/fluent_source.h"
#include "preprocess/formats/vtk/vtk_hdf.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

constexpr int kMaxObjects = 256;
constexpr hsize_t kMaxValues = 1 << 16;

enum Kind : uint8_t { kDataSet, kNumbers, kText, kLink };

class Writer {
 public:
  explicit Writer(const std::filesystem::path& path)
      : file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)),
        parents_(H5Pcreate(H5P_LINK_CREATE)) {
    H5Pset_create_intermediate_group(parents_.id(), 1);
  }

  /// Adds an object. Those that HDF5 refuses to write are left out.
  void add(FuzzInput& input) {
    const auto kind = input.take<uint8_t>() % 4;
    const std::string path = takeText(input);
    if (kind == kDataSet) return addNumbers(input, path, "");
    if (kind == kLink)
      return static_cast<void>(
          H5Lcreate_soft(takeText(input).c_str(), file_.id(), path.c_str(), parents_.id(), H5P_DEFAULT));
    const std::string attribute = takeText(input);
    if (kind == kNumbers) return addNumbers(input, path, attribute);
    const std::string value = takeText(input);
    const Hdf5Type text(H5Tcopy(H5T_C_S1));
    H5Tset_size(text.id(), std::max<size_t>(1, value.size()));
    const Hdf5Space one(H5Screate(H5S_SCALAR));
    write(path, attribute, text.id(), one.id(), value.data());
  }

 private:
  using Properties = Hdf5Handle<H5Pclose>;
  using Object = Hdf5Handle<H5Oclose>;

  static std::string takeText(FuzzInput& input) {
    return std::string(textOf(input.takeBytes(input.take<uint8_t>())));
  }

  void addNumbers(FuzzInput& input, const std::string& path, const std::string& attribute) {
    const hid_t types[] = {H5T_IEEE_F32LE, H5T_IEEE_F64BE, H5T_STD_I8LE,  H5T_STD_U8LE,
                           H5T_STD_I16LE,  H5T_STD_I32BE,  H5T_STD_I64LE, H5T_STD_U64LE};
    const hid_t type = types[input.take<uint8_t>() % std::size(types)];
    std::vector<hsize_t> dims(input.take<uint8_t>() % 6);
    hsize_t values = 1;
    for (hsize_t& n : dims) values *= n = input.take<uint16_t>();
    if (values > kMaxValues) return;
    const auto bytes = input.takeBytes(values * H5Tget_size(type));
    std::vector<std::byte> filled(bytes.begin(), bytes.end());
    filled.resize(std::max<size_t>(1, values * H5Tget_size(type)));
    const Hdf5Space space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
    write(path, attribute, type, space.id(), filled.data());
  }

  /// Writes an attribute or, if its name is empty, a data set.
  void write(const std::string& path, const std::string& attribute, hid_t type, hid_t space,
             const void* values) {
    if (attribute.empty()) {
      const Hdf5DataSet set(
          H5Dcreate2(file_.id(), path.c_str(), type, space, parents_.id(), H5P_DEFAULT, H5P_DEFAULT));
      if (set) H5Dwrite(set.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
      return;
    }
    const Hdf5Group made(
        H5Gcreate2(file_.id(), path.c_str(), parents_.id(), H5P_DEFAULT, H5P_DEFAULT));  // if there is none
    const Object object(H5Oopen(file_.id(), path.c_str(), H5P_DEFAULT));
    if (!object) return;
    const Hdf5Attribute of(H5Acreate2(object.id(), attribute.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT));
    if (of) H5Awrite(of.id(), type, values);
  }

  const Hdf5File file_;
  const Properties parents_;
};

// Objects of a file, one after the other: a byte for its kind, its path as a text (a byte for the length, and the bytes). Then a text for
// what a link leads to; else for the name of an attribute, and its text; or the type, the extent (rank, and 16 bits along each
// dimension) and the values of numbers.
OpenGridOptions written(const char* name, std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFolder() / name;
  options.temporary_folder = fuzzFolder();
  const QuietHdf5 quiet;
  Writer writer(options.grid);
  FuzzInput input(bytes);
  for (int n = 0; n < kMaxObjects && !input.rest().empty(); ++n) writer.add(input);
  return options;
}

void fuzzVtkHdf(std::span<const std::byte> bytes) {
  const OpenGridOptions options = written("a.vtkhdf", bytes);
  if (isVtkHdf(InputFile(options.grid))) readData(openVtkHdf(options));
}

const RegisteredFuzzTarget vtk_hdf_target("vtk_hdf", fuzzVtkHdf);

// A Fluent case and its data in one file.
void fuzzFluent(std::span<const std::byte> bytes) {
  OpenGridOptions options = written("a.cas.h5", bytes);
  options.solutions = {options.grid};
  if (isFluentHdf5(InputFile(options.grid))) readData(openFluent(options));
}

const RegisteredFuzzTarget fluent_target("fluent", fuzzFluent);

}  // namespace
}  // namespace curvisplat
