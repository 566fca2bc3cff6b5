// SPDX-License-Identifier: Apache-2.0
// The table of parameters, and a set of values.
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>

#include "bindings.hpp"

namespace nb = nanobind;

namespace pointfair::python {
namespace {

const char* kind_of(const ParamField& field) {
  if (std::holds_alternative<int Params::*>(field)) return "int";
  if (std::holds_alternative<bool Params::*>(field)) return "switch";
  if (std::holds_alternative<std::optional<double> Params::*>(field)) return "float";
  if (std::holds_alternative<Length Params::*>(field)) return "length";
  return "word";
}

const char* name_of(Stage stage) {
  constexpr const char* kNames[] = {"index", "neighbors", "normals", "fairing", "iterations"};
  return kNames[static_cast<std::size_t>(stage)];
}

// Rows as (name, kind, stage, min, max, automatic, values, help, expert, default).
Rows parameter_table() {
  Rows rows;
  for (const ParamInfo& info : kParams)
    rows.append(nb::make_tuple(std::string(info.name), kind_of(info.field), name_of(info.stage), info.min, info.max,
                               info.automatic, std::string(info.values), std::string(info.help), info.expert,
                               param_text(Params{}, info)));
  return rows;
}

const ParamInfo& row(std::string_view name) {
  const ParamInfo* info = find_param(name);
  if (info == nullptr) throw Error(ErrorKind::usage, "there is no parameter '" + std::string(name) + "'");
  return *info;
}

}  // namespace

void bind_params(nb::module_& module) {
  nb::class_<Params>(module, "Params")
      .def(nb::init<>())
      .def(
          "set", [](Params& self, std::string_view name, std::string_view text) { set_param(self, row(name), text); },
          nb::arg("name"), nb::arg("text"))
      .def(
          "text", [](const Params& self, std::string_view name) { return param_text(self, row(name)); },
          nb::arg("name"))
      .def("check", [](const Params& self) { check_params(self); });
  module.def("paper_preset", &paper_preset);
  module.def("parameter_table", &parameter_table);
}

}  // namespace pointfair::python
