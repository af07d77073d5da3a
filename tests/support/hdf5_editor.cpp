#include "tests/support/hdf5_editor.h"

#include <hdf5.h>

#include <array>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace curvisplat {

// Source: lookup3.c, May 2006, Bob Jenkins, public domain: hashlittle() of an initial value of 0.
uint32_t hdf5Checksum(std::string_view bytes) {
  const auto start = 0xdeadbeef + static_cast<uint32_t>(bytes.size());
  uint32_t a = start, b = start, c = start;
  std::array<uint32_t, 3> word{};
  const auto add = [&](std::string_view some) {
    word = {};
    std::memcpy(word.data(), some.data(), some.size());
    a += word[0];
    b += word[1];
    c += word[2];
  };
  while (bytes.size() > 12) {
    add(bytes.substr(0, 12));
    a = (a - c) ^ std::rotl(c, 4), c += b;
    b = (b - a) ^ std::rotl(a, 6), a += c;
    c = (c - b) ^ std::rotl(b, 8), b += a;
    a = (a - c) ^ std::rotl(c, 16), c += b;
    b = (b - a) ^ std::rotl(a, 19), a += c;
    c = (c - b) ^ std::rotl(b, 4), b += a;
    bytes.remove_prefix(12);
  }
  if (bytes.empty()) return c;
  add(bytes);
  c = (c ^ b) - std::rotl(b, 14);
  a = (a ^ c) - std::rotl(c, 11);
  b = (b ^ a) - std::rotl(a, 25);
  c = (c ^ b) - std::rotl(b, 16);
  a = (a ^ c) - std::rotl(c, 4);
  b = (b ^ a) - std::rotl(a, 14);
  return (c ^ b) - std::rotl(b, 24);
}

bool renewChecksum(std::string_view whole, size_t begin, std::string& changed) {
  constexpr size_t kMin = 8, kMax = 4096;
  for (size_t bytes = kMin; bytes < kMax && begin + bytes + sizeof(uint32_t) <= whole.size(); ++bytes) {
    uint32_t stored = 0;
    std::memcpy(&stored, whole.data() + begin + bytes, sizeof stored);
    if (stored != hdf5Checksum(whole.substr(begin, bytes))) continue;
    const uint32_t renewed = hdf5Checksum(std::string_view(changed).substr(begin, bytes));
    std::memcpy(changed.data() + begin + bytes, &renewed, sizeof renewed);
    return true;
  }
  return false;
}

namespace {

hid_t check(hid_t result) {
  if (result < 0) throw std::runtime_error("Hdf5Editor: HDF5 refuses");
  return result;
}

/// Writes zeros, or `bytes` where there are some.
void write(hid_t object, const std::string& name, hid_t type, hid_t space, std::vector<char> bytes = {}) {
  const hid_t attribute = check(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT));
  bytes.resize(std::max(bytes.size(), size_t{1} << 16));
  if (H5Sget_simple_extent_npoints(space) > 0) check(H5Awrite(attribute, type, bytes.data()));
  H5Aclose(attribute);
}

hid_t fixedString(size_t bytes) {
  const hid_t type = check(H5Tcopy(H5T_C_S1));
  check(H5Tset_size(type, bytes));
  return type;
}

hid_t line(hsize_t count) {
  return check(H5Screate_simple(1, &count, nullptr));
}

std::vector<char> letters(size_t count) {
  return std::vector<char>(count, 'R');
}

void writeHostile(hid_t object, const std::string& name, HostileAttribute hostile) {
  const hid_t one = check(H5Screate(H5S_SCALAR));
  const auto text = [&](size_t bytes) { write(object, name, fixedString(bytes), one, letters(bytes)); };
  switch (hostile) {
    case HostileAttribute::kMissing:
      break;
    case HostileAttribute::kStringOf34:
      return text(34);
    case HostileAttribute::kLongString:
      return text(400);
    case HostileAttribute::kHugeString:
      return text(60'000);
    case HostileAttribute::kVariableString: {
      const hid_t type = fixedString(H5T_VARIABLE);
      const char* const value = "R8";
      const hid_t attribute = check(H5Acreate2(object, name.c_str(), type, one, H5P_DEFAULT, H5P_DEFAULT));
      check(H5Awrite(attribute, type, &value));
      H5Aclose(attribute);
      return;
    }
    case HostileAttribute::kStrings:
      return write(object, name, fixedString(3), line(11), letters(33));
    case HostileAttribute::kNullSpace:
      return write(object, name, fixedString(3), check(H5Screate(H5S_NULL)));
    case HostileAttribute::kEmptySpace:
      return write(object, name, fixedString(3), line(0));
    case HostileAttribute::kInteger:
      return write(object, name, H5T_NATIVE_INT, one);
    case HostileAttribute::kIntegers:
      return write(object, name, H5T_NATIVE_INT64, line(1000));
    case HostileAttribute::kLongLetters:
      return write(object, name, H5T_NATIVE_CHAR, line(1000), letters(1000));
    case HostileAttribute::kReal:
      return write(object, name, H5T_NATIVE_DOUBLE, one);
    case HostileAttribute::kCompound: {
      const hid_t type = check(H5Tcreate(H5T_COMPOUND, 64));
      check(H5Tinsert(type, "text", 0, fixedString(32)));
      check(H5Tinsert(type, "number", 32, H5T_NATIVE_DOUBLE));
      return write(object, name, type, one, letters(64));
    }
    case HostileAttribute::kReference:
      return write(object, name, H5T_STD_REF_OBJ, one);
    case HostileAttribute::kVariableList:
      return write(object, name, check(H5Tvlen_create(H5T_NATIVE_CHAR)), one);
    case HostileAttribute::kArray: {
      const hsize_t count = 200;
      return write(object, name, check(H5Tarray_create2(H5T_NATIVE_CHAR, 1, &count)), one, letters(200));
    }
    case HostileAttribute::kEnumerator: {
      const hid_t type = check(H5Tenum_create(H5T_NATIVE_INT));
      const int zero = 0;
      check(H5Tenum_insert(type, "zero", &zero));
      return write(object, name, type, one);
    }
    case HostileAttribute::kOpaque:
      return write(object, name, check(H5Tcreate(H5T_OPAQUE, 100)), one, letters(100));
  }
}

}  // namespace

Hdf5Editor::Hdf5Editor(const std::filesystem::path& path) {
  // Types and spaces that are left open are closed with the file.
  const hid_t access = check(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  file_ = check(H5Fopen(path.c_str(), H5F_ACC_RDWR, access));
  H5Pclose(access);
}

Hdf5Editor::~Hdf5Editor() {
  H5Fclose(file_);
}

void Hdf5Editor::replaceAttribute(const std::string& object, const std::string& attribute,
                                  HostileAttribute hostile) {
  const hid_t open = check(H5Oopen(file_, object.c_str(), H5P_DEFAULT));
  if (H5Aexists(open, attribute.c_str()) > 0) check(H5Adelete(open, attribute.c_str()));
  writeHostile(open, attribute, hostile);
  H5Oclose(open);
}

void Hdf5Editor::writeText(const std::string& object, const std::string& attribute, const std::string& text,
                           size_t bytes) {
  const hid_t open = check(H5Oopen(file_, object.c_str(), H5P_DEFAULT));
  if (H5Aexists(open, attribute.c_str()) > 0) check(H5Adelete(open, attribute.c_str()));
  write(open, attribute, fixedString(bytes), check(H5Screate(H5S_SCALAR)),
        std::vector<char>(text.begin(), text.end()));
  H5Oclose(open);
}

void Hdf5Editor::group(const std::string& path) {
  check(H5Gclose(check(H5Gcreate2(file_, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT))));
}

void Hdf5Editor::softLink(const std::string& target, const std::string& path) {
  check(H5Lcreate_soft(target.c_str(), file_, path.c_str(), H5P_DEFAULT, H5P_DEFAULT));
}

void Hdf5Editor::hardLink(const std::string& target, const std::string& path) {
  check(H5Lcreate_hard(file_, target.c_str(), file_, path.c_str(), H5P_DEFAULT, H5P_DEFAULT));
}

void Hdf5Editor::remove(const std::string& path) {
  check(H5Ldelete(file_, path.c_str(), H5P_DEFAULT));
}

}  // namespace curvisplat
