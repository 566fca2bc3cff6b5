// SPDX-License-Identifier: Apache-2.0
// pointfair: removes the noise of 3D scans and keeps their shape. This header includes all others.
#pragma once

#include "pointfair/cloud.hpp"
#include "pointfair/depth.hpp"
#include "pointfair/device.hpp"
#include "pointfair/device_points.hpp"
#include "pointfair/export.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/io.hpp"
#include "pointfair/limits.hpp"
#include "pointfair/neighbors.hpp"
#include "pointfair/normals.hpp"
#include "pointfair/outliers.hpp"
#include "pointfair/params.hpp"
#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "pointfair/report.hpp"
#include "pointfair/run_notes.hpp"
#include "pointfair/selection.hpp"
#include "pointfair/tiled_run.hpp"
#include "pointfair/version.hpp"
#include "pointfair/viewpoint.hpp"
