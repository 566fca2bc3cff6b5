// SPDX-License-Identifier: Apache-2.0
// Lengths of points in files: the noise, read for --noise NAME and written for --write-noise, and the displacement.
#pragma once

#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

/// Takes `--noise NAME` out of the parameters, so that what stays there is a length, and returns the name; empty if
/// --noise is not given, or has a length.
std::string take_noise_attribute(ParamArguments& params);

/// Gives the pipeline, which holds the cloud, the attribute's values as the noise at each point. `input` names the
/// cloud in errors. Throws ErrorKind::usage if there is no such attribute of one number a point, or none is positive.
void use_noise_attribute(const Cloud& cloud, const std::string& name, const std::string& input, Pipeline& pipeline);

/// Refuses before the run what would fail after it: a name that files cannot have or that is taken, or a format without
/// further attributes. `flag` names it in errors. Throws ErrorKind::usage.
void check_new_attribute(const Cloud& cloud, const std::string& flag, const std::string& name,
                         const WriteOptions& options);

/// Adds the noise that the last run believed in to `cloud`, as an attribute of floats, NaN for an invalid point.
void write_noise_attribute(Pipeline& pipeline, const Params& params, const std::string& name, std::stop_token stop,
                           Cloud& cloud);

/// Adds how far each point moved from `before`, as an attribute of floats, NaN for an invalid point.
void write_displacement_attribute(const Cloud& before, const std::string& name, Cloud& cloud);

/// How far each point moved, with all digits of the positions; not finite for an invalid point. `out`: for each point.
void displacements(const Cloud& before, const Cloud& after, std::span<double> out);

}  // namespace pointfair::cli
