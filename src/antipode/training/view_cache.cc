#include "antipode/training/view_cache.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "antipode/geometry/look_at.h"
#include "antipode/image/mask.h"
#include "antipode/object/object_view.h"
#include "antipode/render/renderer.h"
#include "antipode/training/mesh_variants.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/seeds.h"
#include "antipode/weights/safetensors.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr int kFindingSize = 96;  // of the small mask that finds the object, pixels

fs::path DescriptionFile(const fs::path& folder) { return folder / "views.json"; }
fs::path CameraFile(const fs::path& folder) { return folder / "cameras.safetensors"; }
fs::path PixelFile(const fs::path& folder) { return folder / "views.raw"; }

nlohmann::json Describe(const MeshCollection& meshes, const ViewCacheOptions& options) {
  nlohmann::json description{{"format", 3},
                             {"views_per_object", options.views_per_object},
                             {"variants", options.variants},
                             {"stretch", options.stretch},
                             {"image_size", options.image_size},
                             {"margin", options.margin},
                             {"wide_share", options.wide_share},
                             {"seed", options.seed}};
  const std::string pack = meshes.PackDigest();
  if (!pack.empty()) description["pack"] = pack;
  const auto sizes = meshes.FileSizes();
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    nlohmann::json object{{"file", meshes.Name(i)}};
    if (pack.empty()) object["bytes"] = sizes[i];
    description["objects"].push_back(std::move(object));
  }
  return description;
}

struct CachedView {
  cv::Mat rgba;
  Rigid3 camera_from_object;
  double focal_length;
};

Viewpoint RandomViewpoint(std::mt19937_64& random, const ViewCacheOptions& options) {
  Viewpoint viewpoint;
  viewpoint.azimuth = UniformIn(random, 0, 360);
  const bool wide = UniformIn(random, 0, 1) < options.wide_share;
  viewpoint.elevation = wide ? UniformIn(random, -80, 85) : UniformIn(random, -5, 65);
  viewpoint.distance = UniformIn(random, 2.4, 7);
  return viewpoint;
}

CachedView RenderView(const Renderer& renderer, std::mt19937_64& random, const ViewCacheOptions& options) {
  const Viewpoint viewpoint = RandomViewpoint(random, options);
  const RenderOptions light = RandomLight(random);
  const Rigid3 camera_from_object = CameraFromObject(viewpoint);
  // The unit sphere at distance d fills the picture: tan(half angle) = 1 / sqrt(d^2 - 1).
  PinholeCamera finder{kFindingSize, kFindingSize, 0, 0, kFindingSize / 2.0, kFindingSize / 2.0};
  finder.fx = finder.fy = kFindingSize / 2.0 * std::sqrt(viewpoint.distance * viewpoint.distance - 1);
  const cv::Rect2d box = MaskBox(renderer.RenderMask(finder, camera_from_object));
  const ObjectCrop crop = LookAtBox(finder, box, {options.image_size, options.margin});
  const Rigid3 crop_from_object = Rigid3{crop.crop_from_camera, Eigen::Vector3d::Zero()} * camera_from_object;
  const Rendering rendering = renderer.Render(crop.camera, crop_from_object, light);
  CachedView view{{}, crop_from_object, crop.camera.fx};
  cv::Mat channels[] = {rendering.image, rendering.mask};
  view.rgba.create(options.image_size, options.image_size, CV_8UC4);
  constexpr int kIdentity[] = {0, 0, 1, 1, 2, 2, 3, 3};
  cv::mixChannels(channels, 2, &view.rgba, 1, kIdentity, 4);
  return view;
}

/// All views of one object in the order of the cache: variants outside, views inside.
std::vector<CachedView> RenderObject(const MeshCollection& meshes, std::size_t object,
                                     const ViewCacheOptions& options) {
  const Mesh mesh = meshes.Load(object);
  std::mt19937_64 random(CombineSeeds(options.seed, HashOfName(meshes.Name(object))));
  std::vector<CachedView> views;
  for (int variant = 0; variant < options.variants; ++variant) {
    const std::size_t other = UniformIndex(random, meshes.size());
    const Renderer renderer(RandomVariant(variant, mesh, [&] { return meshes.Load(other); }, options.stretch, random));
    for (int i = 0; i < options.views_per_object; ++i) views.push_back(RenderView(renderer, random, options));
  }
  return views;
}

class CacheWriter {
 public:
  CacheWriter(const fs::path& folder, std::size_t objects, const ViewCacheOptions& options)
      : views_per_object_(options.variants * options.views_per_object),
        bytes_per_view_(std::size_t(options.image_size) * options.image_size * 4),
        rotations_(objects * views_per_object_ * 9),
        centres_(objects * views_per_object_ * 3),
        focal_lengths_(objects * views_per_object_),
        pixels_(PixelFile(folder).string() + ".partial", std::ios::binary) {
    if (!pixels_) throw BadFile(folder.string(), "cannot be written to", "choose another --cache folder");
  }

  void Put(std::size_t object, const std::vector<CachedView>& views) {
    const std::lock_guard lock(mutex_);
    pixels_.seekp(static_cast<std::streamoff>(object * views_per_object_ * bytes_per_view_));
    for (std::size_t i = 0; i < views.size(); ++i) {
      const std::size_t index = object * views_per_object_ + i;
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = views[i].camera_from_object.rotation;
      std::copy_n(rotation.data(), 9, rotations_.begin() + index * 9);
      std::copy_n(views[i].camera_from_object.translation.data(), 3, centres_.begin() + index * 3);
      focal_lengths_[index] = views[i].focal_length;
      pixels_.write(reinterpret_cast<const char*>(views[i].rgba.data), bytes_per_view_);
    }
  }

  void Finish(const fs::path& folder) {
    pixels_.close();
    if (!pixels_) throw BadFile(PixelFile(folder).string(), "could not be written", "free some disk space");
    const auto count = static_cast<std::int64_t>(focal_lengths_.size());
    TensorFile cameras;
    cameras.tensors["rotation"] = HostTensor::FromDouble({count, 3, 3}, rotations_);
    cameras.tensors["centre"] = HostTensor::FromDouble({count, 3}, centres_);
    cameras.tensors["focal_length"] = HostTensor::FromDouble({count}, focal_lengths_);
    WriteSafetensors(CameraFile(folder), cameras);
    fs::rename(PixelFile(folder).string() + ".partial", PixelFile(folder));
  }

 private:
  std::size_t views_per_object_, bytes_per_view_;
  std::vector<double> rotations_, centres_, focal_lengths_;
  std::ofstream pixels_;
  std::mutex mutex_;
};

void RenderCache(const fs::path& folder, const MeshCollection& meshes,
                 const ViewCacheOptions& options, const ProgressCallback& progress) {
  CacheWriter writer(folder, meshes.size(), options);
  std::atomic<std::size_t> next = 0, finished = 0;
  std::atomic<bool> stop = false;
  std::mutex error_mutex;
  std::exception_ptr error;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < meshes.size() && !stop; i = next++) {
        writer.Put(i, RenderObject(meshes, i, options));
        ++finished;
      }
    } catch (...) {
      const std::lock_guard lock(error_mutex);
      error = std::current_exception();
      stop = true;
    }
  };
  std::vector<std::jthread> workers;
  for (int i = 0; i < options.threads; ++i) workers.emplace_back(work);
  try {
    while (finished < meshes.size() && !stop) {
      if (progress)
        progress({"rendering views", static_cast<std::int64_t>(finished), static_cast<std::int64_t>(meshes.size()), {}});
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
  } catch (...) {
    stop = true;
    workers.clear();
    fs::remove(PixelFile(folder).string() + ".partial");
    throw;
  }
  workers.clear();
  if (error) std::rethrow_exception(error);
  writer.Finish(folder);
}

}  // namespace

RenderOptions RandomLight(std::mt19937_64& random) {
  RenderOptions options;
  options.ambient = static_cast<float>(UniformIn(random, 0.35, 0.9));
  options.light_in_camera = Eigen::Vector3d(UniformIn(random, -1, 1), UniformIn(random, -1, 0.4),
                                            UniformIn(random, -1, -0.2)).cast<float>();
  return options;
}

void ViewCacheOptions::Check() const {
  if (views_per_object < 2) throw InvalidOption("views", "leaves no pair", "use at least 2");
  if (variants < 1) throw InvalidOption("variants", "must be at least 1");
  if (!(stretch >= 1 && stretch <= 3)) throw InvalidOption("stretch", "must be 1 to 3");
  if (image_size < 32 || image_size > 1024) throw InvalidOption("cache image size", "must be 32 to 1024 pixels");
  if (threads < 1) throw InvalidOption("threads", "must be at least 1");
}

ViewCache ViewCache::OpenOrRender(const fs::path& folder, const MeshCollection& meshes,
                                  const ViewCacheOptions& options, const ProgressCallback& progress) {
  options.Check();
  const std::string description = Describe(meshes, options).dump(1);
  const bool current = fs::exists(DescriptionFile(folder)) && fs::exists(PixelFile(folder)) &&
                       ReadFile(DescriptionFile(folder)) == description;
  if (!current) {
    fs::create_directories(folder);
    fs::remove(DescriptionFile(folder));
    RenderCache(folder, meshes, options, progress);
    WriteFileAtomically(DescriptionFile(folder), description);
  }
  return ViewCache(folder);
}

ViewCache::ViewCache(const fs::path& folder) : pixels_(PixelFile(folder)) {
  const auto description = nlohmann::json::parse(ReadFile(DescriptionFile(folder)));
  views_per_group_ = description.at("views_per_object");
  image_size_ = description.at("image_size");
  group_count_ = static_cast<int>(description.at("objects").size()) * description.at("variants").get<int>();
  const SafetensorsReader cameras(CameraFile(folder));
  const HostTensor rotation = cameras.Read("rotation"), centre = cameras.Read("centre"), focal_length = cameras.Read("focal_length");
  const std::size_t count = std::size_t(group_count_) * views_per_group_;
  if (focal_length.As<double>().size() != count || rotation.As<double>().size() != 9 * count ||
      centre.As<double>().size() != 3 * count ||
      pixels_.bytes().size() != count * image_size_ * image_size_ * 4)
    throw BadFile(folder.string(), "the view cache is damaged", "delete the folder to render it anew");
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (std::size_t i = 0; i < count; ++i) {
    poses_.push_back({Eigen::Map<const RowMajor>(rotation.As<double>().data() + 9 * i),
                      Eigen::Map<const Eigen::Vector3d>(centre.As<double>().data() + 3 * i)});
    focal_lengths_.push_back(focal_length.As<double>()[i]);
  }
}

std::size_t ViewCache::Index(int group, int view) const {
  return std::size_t(group) * views_per_group_ + view;
}

cv::Mat ViewCache::Image(int group, int view) const {
  const std::size_t bytes = std::size_t(image_size_) * image_size_ * 4;
  auto* data = const_cast<std::byte*>(pixels_.bytes().data()) + Index(group, view) * bytes;
  return {image_size_, image_size_, CV_8UC4, data};
}

const Rigid3& ViewCache::CameraFromObject(int group, int view) const { return poses_[Index(group, view)]; }

double ViewCache::FocalLength(int group, int view) const { return focal_lengths_[Index(group, view)]; }

}  // namespace antipode
