#pragma once

#include <filesystem>
#include <random>
#include <vector>

#include <torch/torch.h>

#include "antipode/matching/local_features.h"
#include "antipode/matching/xfeat.h"
#include "antipode/render/mesh.h"

namespace antipode {

/// Features of a rendered picture and the points of the surface that they are on.
struct SurfaceFeatures {
  LocalFeatures features;
  torch::Tensor points;  ///< [N, 3] float32, object frame, object radii; not a number where a feature is on nothing

  /// Those of the features at `indices`.
  SurfaceFeatures Select(const torch::Tensor& indices) const;
};

struct SurfacePair {
  SurfaceFeatures reference, query;
};

/// What is true of the features of a pair.
struct TrueMatches {
  torch::Tensor reference, query;  ///< [K] indices of the features that show the same point
  torch::Tensor reference_is_lonely, query_is_lonely;  ///< [M], [N]: none of the other picture's features is near
};

/// Features match that are each other's nearest on the surface and within 0.013 radii, some 4 pixels of a crop; one is lonely
/// if all are farther than 0.035. What is between counts as neither.
TrueMatches MatchSurfaces(const SurfaceFeatures& reference, const SurfaceFeatures& query);

struct MatchingPairOptions {
  int views = 6;               ///< rendered of the object
  int crop_pairs = 4;          ///< of their crops as they are
  int halfway_pairs = 4;       ///< of crops turned to where a camera halfway would stand, see pose/halfway_matching.h
  int crop_size = 640;         ///< pixels, as they are matched
  double rolled_share = 0.5;   ///< objects whose cameras are rolled by up to `greatest_roll_deg`, the others by 5 degrees
  double greatest_roll_deg = 45;
  void Check() const;
};

/// Pairs of views of one object, at most 100 degrees between their optical axes. Cameras, lights and sizes of pictures are
/// random, most pictures smaller than the crops. Crops are paired where the roll between them is below 60 degrees, as after the
/// quarter turns of MatchObjectViews; the rotation under which a pair is turned halfway errs by up to 20, now and then 60 degrees.
std::vector<SurfacePair> RenderMatchingPairs(const XFeat& features, const Mesh& mesh, const MatchingPairOptions& options,
                                             std::mt19937_64& random);

}  // namespace antipode
