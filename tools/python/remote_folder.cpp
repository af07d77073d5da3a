#include "tools/python/remote_folder.h"

#include <cerrno>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace py = pybind11;

namespace curvisplat::python {
namespace {

/// Calls Python. Whoever lets go of the object last may be any thread.
Fetch fetchBy(py::object function) {
  const std::shared_ptr<py::object> shared(new py::object(std::move(function)), [](py::object* object) {
    const py::gil_scoped_acquire locked;
    delete object;
  });
  return [shared](const std::string& name, uint64_t offset, uint64_t count) {
    const py::gil_scoped_acquire locked;
    Fetched fetched;
    try {
      const py::tuple sent = (*shared)(name, offset, count);
      fetched.error = sent[0].cast<int>();
      fetched.file_bytes = sent[1].cast<uint64_t>();
      const std::string_view bytes = sent[2].cast<std::string_view>();
      fetched.bytes.resize(bytes.size());
      std::memcpy(fetched.bytes.data(), bytes.data(), bytes.size());
    } catch (const std::exception&) {
      fetched.error = EIO;  // the function has kept what it is
    }
    return fetched;
  };
}

}  // namespace

RemoteFolder::RemoteFolder(const std::filesystem::path& parent, py::object fetch)
    : folder_(parent, ".remote"), mirror_(folder_.path(), fetchBy(std::move(fetch))) {}

}  // namespace curvisplat::python
