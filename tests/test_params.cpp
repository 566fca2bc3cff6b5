// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

// Converts to the type of any field, so that Params{anything, anything, ...} compiles for as many as it has fields.
struct Anything {
  template <class T>
  operator T() const;
};

template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...>) {
  return requires { T{((void)I, Anything{})...}; };
}
template <class T, std::size_t N = 0>
constexpr std::size_t field_count() {
  if constexpr (takes<T>(std::make_index_sequence<N + 1>())) {
    return field_count<T, N + 1>();
  } else {
    return N;
  }
}

const ParamInfo& row(std::string_view name) {
  const ParamInfo* info = find_param(name);
  if (!info) throw std::runtime_error("no parameter " + std::string(name));
  return *info;
}

std::string refusal(std::string_view name, std::string_view text) {
  Params params;
  const test::Thrown thrown = test::thrown_by([&] { set_param(params, row(name), text); });
  EXPECT_EQ(thrown.kind, ErrorKind::usage);
  EXPECT_EQ(params, Params{}) << "a refused value changed the parameters";
  return thrown.message;
}

TEST(ParamTable, has_one_row_for_every_field) {
  std::set<std::string_view> names;
  for (const ParamInfo& info : kParams) names.insert(info.name);
  EXPECT_EQ(names.size(), kParams.size());
  for (std::size_t a = 0; a < kParams.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) EXPECT_FALSE(kParams[a].field == kParams[b].field) << kParams[a].name;
  EXPECT_EQ(kParams.size(), field_count<Params>());
}

TEST(ParamTable, is_in_the_order_of_the_stages_and_explains_each_row) {
  for (std::size_t i = 0; i < kParams.size(); ++i) {
    const ParamInfo& info = kParams[i];
    EXPECT_FALSE(info.help.empty()) << info.name;
    EXPECT_LE(info.min, info.max) << info.name;
    EXPECT_GE(info.stage, kParams[i == 0 ? 0 : i - 1].stage) << info.name;
  }
}

TEST(ParamTable, rows_are_found_with_dashes_or_underscores_and_by_the_whole_name_only) {
  for (const ParamInfo& info : kParams) {
    std::string flag(info.name);
    std::replace(flag.begin(), flag.end(), '_', '-');
    EXPECT_EQ(find_param(info.name), &info);
    EXPECT_EQ(find_param(flag), &info);
    EXPECT_EQ(find_param(flag + "s"), nullptr);
    EXPECT_EQ(find_param(flag.substr(1)), nullptr);
  }
  EXPECT_EQ(find_param(""), nullptr);
}

TEST(ParamText, of_the_defaults_reads_back_as_the_defaults) {
  Params params = paper_preset();
  for (const ParamInfo& info : kParams) set_param(params, info, param_text(Params{}, info));
  EXPECT_EQ(params, Params{});
}

TEST(ParamText, says_auto_where_auto_is_allowed_and_the_data_decides) {
  for (const ParamInfo& info : kParams) EXPECT_EQ(param_text(Params{}, info) == "auto", info.automatic) << info.name;
}

TEST(ParamText, reads_back_the_same_for_random_values) {
  shapes::Random random(17);
  for (int i = 0; i < 20000; ++i) {
    const ParamInfo& info = kParams[random.below(kParams.size())];
    Params params;
    if (const auto* number = std::get_if<int Params::*>(&info.field)) {
      params.*(*number) = int(info.min) + int(random.below(std::uint64_t(info.max - info.min) + 1));
    } else if (const auto* factor = std::get_if<std::optional<double> Params::*>(&info.field)) {
      params.*(*factor) = random.uniform(info.min, info.max);
    } else if (const auto* length = std::get_if<Length Params::*>(&info.field)) {
      const double value = std::ldexp(random.uniform(0.5, 1), int(random.below(80)) - 50);
      params.*(*length) = Length(value, Length::Unit(1 + random.below(3)));
    }
    Params again;
    set_param(again, info, param_text(params, info));
    ASSERT_EQ(again, params) << info.name << " " << param_text(params, info);
  }
}

TEST(ParamText, of_words_reads_back_the_same_for_every_word) {
  for (const ParamInfo& info : kParams) {
    std::string_view words = info.values;
    while (!words.empty()) {
      const std::string_view word = words.substr(0, words.find('|'));
      words.remove_prefix(std::min(words.size(), word.size() + 1));
      Params params;
      set_param(params, info, word);
      EXPECT_EQ(param_text(params, info), word) << info.name;
    }
  }
}

TEST(SetParam, reads_the_units_of_a_length) {
  Params params;
  const auto read = [&](std::string_view text) {
    set_param(params, row("radius"), text);
    return params.radius;
  };
  EXPECT_EQ(read("0.02"), Length(0.02, Length::Unit::file));
  EXPECT_EQ(read("1e-3"), Length(0.001, Length::Unit::file));
  EXPECT_EQ(read("0.5%"), Length(0.5, Length::Unit::percent));
  EXPECT_EQ(read("2s"), Length(2, Length::Unit::spacing));
  EXPECT_TRUE(read("auto").is_automatic());
}

TEST(SetParam, reads_units_of_lengths_as_metres) {
  const auto metres = [](const char* text) {
    Params params;
    set_param(params, *find_param("noise"), text);
    EXPECT_EQ(params.noise.unit, Length::Unit::metre) << text;
    return params.noise.value;
  };
  EXPECT_DOUBLE_EQ(metres("5mm"), 0.005);
  EXPECT_DOUBLE_EQ(metres("1.5cm"), 0.015);
  EXPECT_DOUBLE_EQ(metres("0.02m"), 0.02);
  EXPECT_DOUBLE_EQ(metres("2ft"), 0.6096);
  Params params;
  for (const char* text : {"5 mm", "mm", "-5mm", "5km", "5in", "5mmm", "5m%", "5%m", "5sm"})
    EXPECT_THROW(set_param(params, *find_param("noise"), text), Error) << text;
}

TEST(InFileUnits, divides_metres_by_the_unit_and_refuses_them_where_there_is_none) {
  Params params{.noise = {0.3048, Length::Unit::metre}, .radius = {2, Length::Unit::spacing}};
  EXPECT_EQ(in_file_units(params, 0.3048).noise, Length(1.0));
  EXPECT_EQ(in_file_units(params, 0.3048).radius, params.radius);
  const std::string said = test::thrown_by([&] { in_file_units(params, std::nullopt); }).message;
  EXPECT_EQ(said.find("0.3048"), std::string::npos) << "1ft was typed: " << said;
  EXPECT_EQ(said.find("--noise: "), 0u) << said;
  params.noise = 5.0;
  EXPECT_EQ(in_file_units(params, std::nullopt), params);
}

TEST(SetParam, knows_multiples_of_the_radius_for_the_widths_of_gaussians_only) {
  Params params;
  set_param(params, row("closeness_sigma"), "0.6r");
  EXPECT_EQ(params.closeness_sigma, Length(0.6, Length::Unit::radius));
  EXPECT_EQ(param_text(params, row("closeness_sigma")), "0.6r");
  set_param(params, row("normal_sigma"), "1r");
  EXPECT_EQ(params.normal_sigma, Length(1, Length::Unit::radius));
  EXPECT_NE(refusal("radius", "2r").find("--radius"), std::string::npos);
  EXPECT_NE(refusal("similarity_sigma", "2r").find("--similarity-sigma"), std::string::npos);
}

TEST(SetParam, reads_words_and_whole_numbers) {
  Params params;
  set_param(params, row("k"), "512");
  EXPECT_EQ(params.k, 512);
  set_param(params, row("k"), "auto");
  EXPECT_EQ(params.k, kAutomatic);
  set_param(params, row("constraint"), "on");
  EXPECT_TRUE(params.constraint);
  set_param(params, row("relaxation"), "1.5");
  EXPECT_EQ(params.relaxation, 1.5);
  set_param(params, row("relaxation"), "auto");
  EXPECT_EQ(params.relaxation, std::nullopt);
  set_param(params, row("area-weight"), "squared");
  EXPECT_EQ(params.area_weight, AreaWeight::squared);
  set_param(params, row("offset"), "symmetric");
  EXPECT_EQ(params.offset, Offset::symmetric);
  set_param(params, row("offset"), "auto");
  EXPECT_EQ(params.offset, Offset::automatic);
}

TEST(SetParam, refuses_what_is_out_of_range_or_no_value_and_says_the_flag_and_the_value) {
  const std::vector<std::pair<std::string_view, std::vector<std::string_view>>> bad = {
      {"k", {"0", "513", "-1", "8.5", "eight", "", "8 ", "1e9", "nan"}},
      {"iterations", {"0", "101"}},
      {"radius", {"0", "-1", "nan", "inf", "2x", "%", "s", "1e31", "0%", "2 s"}},
      {"rho", {"-0.5%"}},
      {"method", {"best"}},
      {"area_weight", {"auto"}},
      {"constraint", {"maybe", "auto", ""}},
      {"normal_filter", {"1"}},
      {"relaxation", {"2.1", "-0.1", "nan", "90%"}},
      {"flat_scale", {"0.9"}}};
  for (const auto& [name, texts] : bad)
    for (const std::string_view text : texts) {
      const std::string message = refusal(name, text);
      std::string flag = "--" + std::string(name);
      std::replace(flag.begin(), flag.end(), '_', '-');
      EXPECT_NE(message.find(flag), std::string::npos) << name << "=" << text << ": " << message;
      const std::string quoted = std::string("'").append(text).append("'");
      EXPECT_NE(message.find(quoted), std::string::npos) << name << "=" << text << ": " << message;
      EXPECT_EQ(message.find('\n'), std::string::npos);
    }
}

TEST(CheckParams, accepts_the_defaults_and_the_papers_preset) {
  EXPECT_NO_THROW(check_params(Params{}));
  EXPECT_NO_THROW(check_params(paper_preset()));
}

TEST(CheckParams, refuses_values_that_set_param_would_refuse) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Params all[] = {{.k = 513},
                        {.k = -1},
                        {.iterations = 101},
                        {.relaxation = 2.5},
                        {.relaxation = nan},
                        {.radius = 0.0},
                        {.noise = 0.0},
                        {.rho = -1.0},
                        {.normal_sigma = nan},
                        {.closeness_sigma = {-1, Length::Unit::spacing}}};
  for (const Params& params : all) expect_error(ErrorKind::usage, "", [&] { check_params(params); });
}

TEST(CheckParams, refuses_the_constraint_with_a_radius_alone) {
  Params params{.radius = 0.1, .constraint = true};
  expect_error(ErrorKind::usage, "", [&] { check_params(params); });
  params.k = 8;
  EXPECT_NO_THROW(check_params(params));
}

}  // namespace
}  // namespace pointfair
