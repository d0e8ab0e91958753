#pragma once

#include <cstdint>
#include <deque>
#include <future>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <torch/torch.h>

#include "antipode/training/augmentation.h"
#include "antipode/training/view_cache.h"

namespace antipode {

/// Views of several objects, group by group.
struct ViewBatch {
  torch::Tensor rgba;                      ///< [groups * views, 4, S, S], U8
  std::vector<Rigid3> camera_from_object;  ///< one a view, see AugmentedView
  std::vector<double> focal_lengths;       ///< one a view
  int groups = 0;

  std::vector<Eigen::Matrix3d> Rotations() const;  ///< of camera_from_object
};

/// Draws and augments batches in the background. Batch `index` depends on the seed and the index alone.
class BatchLoader {
 public:
  BatchLoader(const ViewCache& cache, int groups, int views, int image_size,
              const AugmentationOptions& augmentation, std::uint64_t seed);

  /// The batch `index`; starts preparing the next ones.
  ViewBatch Get(std::int64_t index);

 private:
  ViewBatch Make(std::int64_t index) const;

  const ViewCache& cache_;
  int groups_, views_, image_size_;
  AugmentationOptions augmentation_;
  std::uint64_t seed_;
  std::deque<std::pair<std::int64_t, std::future<ViewBatch>>> ahead_;
};

}  // namespace antipode
