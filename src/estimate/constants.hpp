// SPDX-License-Identifier: Apache-2.0
// Every constant of the estimates and of what follows from them. The comment beside a constant gives its unit, the
// equation of docs/how-it-works.md that has it, and what measured it: a record of docs/decisions by its number, or a
// command:
//   estimates, steady, low, sheets, outliers, scans    a part of bench/automatic.py
//   quality                                            bench/quality.py
// Of a pair, the first number is where a rule begins to act and the second where it acts in full.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "point/neighborhoods.h"
#include "point/sample.h"

namespace pointfair::constants {

// Samples.                                               unit; equation; measured by
inline constexpr std::size_t kNoiseSamples = 500, kLeastSamples = 128;  // samples of the cloud; (8); estimates, 028
inline constexpr std::uint64_t kPointsOfSample = 8;                     // points of the cloud for one, in between; 028
inline constexpr std::uint64_t kPointsOfPlace = 150;                    // measurements for one more place; (21); 082

// Points that are no measurements of their own.
inline constexpr int kRepeatNeighbors = 64, kMostRepeats = 16;  // points; 141
inline constexpr int kMostCopies = 2;            // times the points at one place; of more repeats, noise is shared; 141
inline constexpr double kEvenDistances = 0.4;    // of squared distance over rank; chance is 0.69; 141
inline constexpr double kBeyondCopies = 3;       // distances to copies, in which few others lie; 141
inline constexpr double kFewOthers = 0.7;        // of the copies; on lines there are 2, by chance 8; 141
inline constexpr std::size_t kFewestCopies = 8;  // samples that have some; 141
inline constexpr double kFullRows = 0.05;        // of the samples may have more points in that distance; 141
inline constexpr double kNearlyAll = 0.98;       // of the copies; 141
inline constexpr double kWithinCopies = 2;       // distances to nearly all copies; 141
inline constexpr double kSurelyCopies = 0.01;    // spacings; farther copies are less apart than the noise; 141
inline constexpr double kStepsOfChance = 2;      // of coordinates, within which chance brings 12 times the copies; 141
inline constexpr std::size_t kMostOfSteps = 2;   // times the copies; of more points there, copies are chance; 141

// Rows of points that share an error.
inline constexpr std::size_t kRowSamples = 150;                    // samples; 141
inline constexpr int kRowNeighbors = 512;                          // points; 141
inline constexpr double kRowShare = 0.1;                           // of the samples; 141
inline constexpr double kGapOfRows = 8, kMostRows = 50;            // median gaps; rows across a neighbourhood; 141
inline constexpr std::size_t kFewestOfRow = 8, kFewestRows = 6;    // points; rows; 141
inline constexpr double kLeastRowOffset = 1, kMostRowOffset = 20;  // of what a row's points lie off; others .8; 141
inline constexpr double kRowJump = 2.2;  // chance is 2.3 or more over a parabola, waves of four rows 2; 141

// Whether neighbours share their noise.
inline constexpr std::size_t kNearRank = 6, kFarRanks[] = {18, 36};  // points along the plane, nearest first; 075
inline constexpr double kNearOverFar = 0.9;     // of their differences in height; chance is .96, shared noise .84; 075
inline constexpr int kPlaneRounds = 2;          // without points that lie far off; 075
inline constexpr double kFarOffPlane = 4;       // median heights over the plane; 075
inline constexpr double kMostDifference = 1.3;  // noises; independent ones differ by .95 (median), more is shape; 075

// A surface among what is none.
inline constexpr double kMessyNoise = 0.4;       // spacings; of more, the nearest points may hide a surface; 165
inline constexpr double kQuietNoise = 0.2;       // spacings; of less, places among those are a surface; 165
inline constexpr double kMostBetween = 1.0 / 3;  // of as many as these have noise between the two; 165
inline constexpr double kGrowthOfVolume = 1.35;  // of residuals from 30 to 115 points; crowns 1.5, noise 1.2; 165
inline constexpr double kHiddenNoise = 0.015;    // of the distance to the 16th nearest; chance is below 0.1 %; 165
inline constexpr double kFurtherNoise = 3, kFurtherShare = 0.125;  // of that; of the next 16 points; 165
inline constexpr double kSameSurface = 0.2;      // sine of an angle; of one surface .1 at most, of others .35; 165
inline constexpr double kHiddenShare = 0.02;     // of the samples; 165
inline constexpr std::size_t kFewestHidden = 8;  // samples; 165
inline constexpr double kNextToNone = 1.0 / 8;   // of the surface's noise, where there is none; 165
inline constexpr double kEndless = 1e9;          // of what cannot be told

// Noise of a typical place.
inline constexpr double kNoiseQuantile =
    0.35;  // of the samples: edges and outliers only raise a residual; (8); estimates
inline constexpr double kLeastQuantile = 0.15;  // of the samples, where they spread; (8); estimates
inline constexpr double kMostOverLeast = 1.2;   // of the residual at that quantile; (8); estimates
inline constexpr double kSheetShare = 0.25;     // of the samples; fewer that see two sheets are a part; sheets, 028
inline constexpr double kThinShare = 0.5;       // of the samples may see two sheets; of other clouds less; sheets, 028
inline constexpr double kBeyondEven = 0.01;     // of residuals beyond two deviations; fewer of even noise; sheets, 028
inline constexpr double kGapQuantile = 0.25;    // of the gaps between sheets; sheets
inline constexpr std::array kGrowthOfShape{1.0, 1.24, 1.2};  // of residuals from 11 points to 30, 60, 115; (25); 028
inline constexpr double kFlattest = 0.1;                     // of the samples; 028
inline constexpr std::array kShownByFlattest{0.516, 0.681, 0.712};  // of the noise there, by chance
inline constexpr double kHiddenFromFew = 0.53;     // spacings; of more noise few points show less; (25); 028
inline constexpr double kMostOverFlattest = 1.15;  // of the noise that they show, by chance; (25); 028
inline constexpr double kDoubtfulNoise = 0.6;      // spacings; below it residuals may be shape; low
inline constexpr double kNearFlat = 2;  // flattest residuals; larger ones are beyond the similarity sigma; low

// Noise that is large against the spacing, by every fourth or sixteenth point.
inline constexpr double kDenseNoise = 0.9;        // spacings; 082
inline constexpr double kConfinedThinned = 0.15;  // of the samples; of more, the noise is shape; 082
inline constexpr double kGrowthThinned = 1.1;     // ratio of median residuals, from 30 points to 60; 082

// How residuals grow from one neighbourhood to one of twice the points.
inline constexpr double kOwnGrowth = 1.05;                   // ratio of median residuals of noise alone; 082
inline constexpr double kShapeVarianceGrowth = 4;            // ratio of variances of shape: a quadric's; 082
inline constexpr double kCorrelatedGrowth[] = {1.14, 1.18};  // ratio in flat places (1.09 is chance); 075
inline constexpr double kCorrelatedSlowing[] = {1.2, 0.9};   // the next growth over this one; more is shape; 075
inline constexpr double kMostlyCorrelated = 0.9;             // correlation, 0 to 1; from there on noise is shared; 075
inline constexpr double kMostFarNoise = 0.45;         // spacings, of these copies and of all points; more is shape; 075
inline constexpr double kFarSlowing[] = {0.25, 1.6};  // the next growth over one; less is a relief of one wave; 075
inline constexpr double kMoreGrowth = 0.15;           // of thinned copies over that of all points; 075
inline constexpr double kMostOfSecond = 0.8;  // residual over spacing, of every eighth point over every second; 075
inline constexpr std::uint64_t kLeastMeasurements = 256;  // of a cloud, of several points each; one row holds 64; 075

// Noise that grows with the square of the distance, as the steps between pixels show it.
inline constexpr std::size_t kStepGroups = 8;            // of samples; 076
inline constexpr double kMostUneven = 1.55;              // second nearest over nearest; chance is 3.2; 076
inline constexpr double kLeastStepRange = 0.5;           // of the logarithms of steps; 076
inline constexpr double kSquareOfSteps[] = {1.4, 2.85};  // powers of the step; 076
inline constexpr double kMostSpreadOfSquare = 0.85;      // of residuals over squared steps, of that of residuals; 076

// Noise from place to place.
inline constexpr double kWideAgainstResiduals = 2.6;  // radius of a neighbourhood that cuts off none; (21); 082
inline constexpr std::size_t kPool = point::kPool;    // samples whose residuals stand for one place; (21); 082
inline constexpr std::size_t kSmoothed = 8;           // samples whose median is the noise of a place; (21); 082
inline constexpr double kFitError = 0.1;              // of log variances, beside chance; (21); 082
inline constexpr double kSpread = 0.7;                // of log levels, before anything is known; (21); 082
inline constexpr double kChanceOfLevels = 0.1;        // of log levels, by the samples alone; (21); 082
inline constexpr double kLargestLevel = 32;           // of the typical place, and its inverse the least; (21); 082
inline constexpr std::array kShapePowers{1.3, 2.0, 3.0, 4.0};  // of the size, by which shape grows; (21); 082
inline constexpr int kLeastShape = -10, kMostShape = 8;        // half decades of shape over noise; (21); 082
inline constexpr int kMostNodes = 32;                          // of the grid of levels along an axis; 082
inline constexpr double kAside = 0.01;                         // of the places, at either end of each axis; 082
inline constexpr std::size_t kMostGivenPlaces = 32768;         // points whose noise is given: as many as nodes; 082
inline constexpr std::array kReportedQuantiles{0.05, 0.5, 0.95};

// Steps of coordinates and of depth.
inline constexpr std::size_t kLookedAt = point::kNearRows;      // samples; 075
inline constexpr int kStepNeighbors = 8, kLevelNeighbors = 60;  // points; 075
inline constexpr double kRounding = 2.4e-7;                     // extents: 4 units in the last place of a float
inline constexpr std::size_t kRepeats = 20;                     // of each value, on average, if there are steps; 075
inline constexpr std::size_t kGlance = 256;                     // values; fewer than half of them are distinct
inline constexpr double kOverEachOther = 0.1;                   // of neighbours, in coarse steps; on a grid none; 075
inline constexpr double kRegularShare = 0.9;                    // of the samples; 141
inline constexpr double kSameStep = 0.05;                       // of the step; 075
inline constexpr double kExactPlane = 1e-4;                     // of a neighbourhood's size; 075
inline constexpr double kRoundness = 0.05;                      // ratio of eigenvalues; less is a line; 075
inline constexpr std::size_t kFewestPlanes = 10, kMostPlanes = 400;  // of 500 samples; 075
inline constexpr double kSameDirection = 0.99985;                    // the cosine of 1 degree; 075
inline constexpr double kLevelGap = 2e-6;                            // extents; heights are not nearer; 075
inline constexpr std::size_t kHeightsOfLevel = 8;                    // points, on average; 075
inline constexpr std::size_t kSpans = 8;                             // spans of levels; 075
inline constexpr double kWideningOfGaps = 1.1;     // ratio, from the nearest level to the farthest; 075
inline constexpr double kStepsOfGap = 3;           // steps; points on two or three values are no sheets; 075
inline constexpr double kNoiseOfDepthSteps = 0.5;  // steps; Khoshelham and Elberink 2012; 075

// Neighbourhoods.
inline constexpr double kNoiseRadius = 2.5;                      // sigmas; R of (18); quality
inline constexpr int kMinNeighbors = 16;                         // points; quality
inline constexpr double kRoominess = 1.15, kConfinement = 0.67;  // of R; (18); 052
inline constexpr double kRoomyNoise[] = {0.5, 0.85};             // spacings; (18); 052
inline constexpr double kUnseenNoise[] = {3.6, 4.4};             // spacings; (18); 052
inline constexpr double kDepthWidening = 3;                      // of R: a matcher's windows are nine pixels wide; 075
inline constexpr double kFlatPercent[] = {130, 160};  // of R, with little noise and with more; (20); 052, 143
inline constexpr double kSeparableGap = 1.4, kApartFromNoise = 3;  // spacings and sigmas between two sheets; sheets
inline constexpr double kOneSheet = 0.65, kBothSheets = 14;        // of one sheet's points within the gap; sheets
inline constexpr double kQuietSheets = 8;     // sigmas; sheets farther apart need no points of both; 028
inline constexpr double kMostlySheets = 0.7;  // of the samples; a thin part needs points of both nevertheless; 028
inline constexpr double kListRadius = 3;      // sigmas, of lists; quality
inline constexpr double kListPoints = 11;     // points, of lists without noise; quality

// Width from place to place.
inline constexpr double kReachPoints =
    point::kReachPoints;                      // points; with so many of least risk the reach stays as it is; (23); 102
inline constexpr double kNoiseOfWidth = 1.5;  // spacings; from there on the noise alone sets the width; (23); 102
inline constexpr double kWidestReach = 2;     // of the reach, and its inverse the narrowest; (23); 102

// Weights and normals.
inline constexpr double kNormalWidth = 1.4, kClosenessWidth = 0.6;  // of R; (3), (4); quality
inline constexpr double kListCloseness = 0.5;                       // of a list's radius; Fleishman 2003
inline constexpr double kUniformCloseness = 1e6;                    // of a ring's radius: all weights are 1; 170
inline constexpr double kTangential = 1;                            // of the way along the surface; 170
inline constexpr int kGraphNeighbors = 8;                           // of method implicit; 170
inline constexpr double kLambda = 5.5, kLambdaPower = 0.5;          // of method implicit, noise in spacings; 170
inline constexpr double kMostLambda = 100;                          // squared edges; 170
inline constexpr double kSimilarityWidth = 3;                       // sigmas; (4); quality
inline constexpr double kLeastSimilarity = 0.05;                    // spacings; low
inline constexpr double kSheetSimilarity = 1.0 / 6;                 // of the gap; sheets
inline constexpr int kCreaseAngle = 15;                             // degrees; quality

// The step.
inline constexpr int kIterations = 2;                   // quality
inline constexpr double kTrustedNoise = 0.01;           // spacings; half of a step is made there; 082
inline constexpr double kWidthDamage = 1.5;             // by two iterations and the filter of normals; (23); 102
inline constexpr double kDamage = 0.4;                  // c of (22); 082
inline constexpr double kHarmlessNoise[] = {0.2, 0.6};  // spacings; c of (22) below 1, F of (20), other methods; 082
inline constexpr double kShapeDamage = 3, kUnseenShape = 0.01;  // noise variances; other methods; 082

// Outliers that a sensor saw.
inline constexpr double kStepSpread = 1.1;        // of the spread of distances, by chance; 156
inline constexpr double kPlaceSpread = 0.6;       // the same, from a place that nobody gave; 156
inline constexpr double kMostStepSpread = 0.693;  // of logarithms of steps from there: a factor of 2; 156
inline constexpr int kPlaceRounds = 8;            // of its search; 156
inline constexpr std::size_t kGlancedAt = 128;    // samples that tell whether a whole search is worth it; 156
inline constexpr int kGlanceRounds = 4;           // of theirs; 156
inline constexpr double kGlanceSpread = 0.8;      // the same as kPlaceSpread; 156

// Limits.
inline constexpr double kFarthestMove = 10;             // sigmas; 040
inline constexpr double kFarthestOfNoise[] = {1.5, 4};  // sigmas, of little and of much; other methods; low
inline constexpr double kFarNoise[] = {0.03, 0.5};      // spacings; other methods; low
inline constexpr double kOutlierDistance = 6;           // sigmas; outliers
inline constexpr double kOutlierSpacings = 0.75;        // spacings; outliers
inline constexpr double kOutlierRadius = 6;             // of what holds a typical point's neighbours; outliers
inline constexpr double kNoiseOfDelta = 2.5;            // sigmas; delta of the paper's constraint

}  // namespace pointfair::constants
