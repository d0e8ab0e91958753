#include "antipode/training/batch_loader.h"

#include <algorithm>

#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr int kBatchesAhead = 2;

}  // namespace

std::vector<Eigen::Matrix3d> ViewBatch::Rotations() const {
  std::vector<Eigen::Matrix3d> rotations;
  for (const Rigid3& pose : camera_from_object) rotations.push_back(pose.rotation);
  return rotations;
}

BatchLoader::BatchLoader(const ViewCache& cache, int groups, int views, int image_size,
                         const AugmentationOptions& augmentation, std::uint64_t seed)
    : cache_(cache),
      groups_(std::min(groups, cache.group_count())),
      views_(std::min(views, cache.views_per_group())),
      image_size_(image_size),
      augmentation_(augmentation),
      seed_(seed) {}

ViewBatch BatchLoader::Get(std::int64_t index) {
  if (!ahead_.empty() && ahead_.front().first != index) ahead_.clear();
  for (std::int64_t next = index + static_cast<std::int64_t>(ahead_.size()); next <= index + kBatchesAhead; ++next)
    ahead_.emplace_back(next, std::async(std::launch::async, [this, next] { return Make(next); }));
  ViewBatch batch = ahead_.front().second.get();
  ahead_.pop_front();
  return batch;
}

ViewBatch BatchLoader::Make(std::int64_t index) const {
  std::mt19937_64 random(CombineSeeds(seed_, static_cast<std::uint64_t>(index)));
  ViewBatch batch;
  batch.groups = groups_;
  auto pixels = torch::empty({groups_ * views_, image_size_, image_size_, 4}, torch::kUInt8);
  std::uint8_t* destination = pixels.data_ptr<std::uint8_t>();
  for (const int group : DrawDistinct<int>(groups_, cache_.group_count(), random)) {
    const RollRegime regime = DrawRegime(augmentation_, random);
    const bool mirrored = UniformIn(random, 0, 1) < augmentation_.mirror_share;
    for (const int view : DrawDistinct<int>(views_, cache_.views_per_group(), random)) {
      const double roll = DrawRoll(regime, augmentation_, random);
      const AugmentedView augmented = AugmentView(cache_, group, view, roll, mirrored, image_size_, augmentation_, random);
      const std::size_t bytes = augmented.rgba.total() * 4;
      std::copy_n(augmented.rgba.ptr<std::uint8_t>(), bytes, destination);
      destination += bytes;
      batch.camera_from_object.push_back(augmented.camera_from_object);
      batch.focal_lengths.push_back(augmented.focal_length);
    }
  }
  batch.rgba = pixels.permute({0, 3, 1, 2});
  return batch;
}

}  // namespace antipode
