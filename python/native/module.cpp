// SPDX-License-Identifier: Apache-2.0
// The module pointfair._native: the library's calls for Python. The package's Python files are the interface.
#include <nanobind/stl/string.h>

#include <new>

#include "bindings.hpp"

namespace nb = nanobind;

namespace pointfair::python {
namespace {

const char* class_name(ErrorKind kind) {
  constexpr const char* kNames[] = {"Error", "UsageError", "FileError", "OutOfMemory", "DeviceError", "Error"};
  return kNames[static_cast<std::size_t>(kind)];
}

void rename_flag(std::string& message, const std::string& flag, std::string_view name) {
  for (std::size_t at = 0; (at = message.find(flag, at)) != std::string::npos;) {
    const std::size_t end = at + flag.size();
    const bool whole = end == message.size() || (message[end] != '-' && (message[end] < 'a' || message[end] > 'z'));
    if (whole) message.replace(at, flag.size(), name);
    at += whole ? name.size() : flag.size();
  }
}

void raise(const char* name, const std::string& message) {
  const nb::object errors = nb::module_::import_("pointfair._errors");
  // names of files are bytes, which need not be text
  const auto length = static_cast<Py_ssize_t>(message.size());
  const nb::object text = nb::steal(PyUnicode_DecodeUTF8(message.data(), length, "backslashreplace"));
  PyErr_SetObject(errors.attr(name).ptr(), text.ptr());
}

void translate(const std::exception_ptr& exception, void*) {
  try {
    std::rethrow_exception(exception);
  } catch (const Error& error) {
    raise(class_name(error.kind()), in_python(error.what()));
  } catch (const std::bad_alloc&) {
    raise("OutOfMemory", "out of host memory: give fewer points, or a smaller k");
  }
}

}  // namespace

std::string in_python(std::string message) {
  rename_flag(message, "--viewpoint x,y,z", "viewpoint=(x, y, z)");
  rename_flag(message, "--viewpoint none", "viewpoint=(nan, nan, nan)");
  for (const ParamInfo& info : kParams) rename_flag(message, flag_of(info.name), info.name);
  for (const std::string_view name : kLimitNames) rename_flag(message, flag_of(name), name);
  for (const std::string_view name : {"viewpoint", "columns", "skip", "strict", "encoding", "device"})
    rename_flag(message, flag_of(name), name);
  rename_flag(message, "--in-format", "format");
  return message;
}

}  // namespace pointfair::python

NB_MODULE(_native, module) {
  using namespace pointfair::python;
  nb::set_leak_warnings(false);  // what waits for the next call lives until the process ends
  nb::register_exception_translator(translate);
  module.def("version", &pointfair::version);
  module.attr("MAX_POINTS") = pointfair::kMaxPoints;
  bind_params(module);
  bind_clouds(module);
  bind_pipelines(module);
  bind_functions(module);
}
