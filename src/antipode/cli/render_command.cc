#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iostream>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/progress_line.h"
#include "antipode/geometry/look_at.h"
#include "antipode/geometry/rotation.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/image/draw.h"
#include "antipode/image/load.h"
#include "antipode/render/renderer.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kMaxViews = 100'000;
constexpr int kThumbnailSide = 160;
constexpr int kMaxThumbnails = 100;

struct RenderRequest {
  std::string mesh, out;
  int views = 12;
  std::vector<double> azimuths, elevations;
  double in_plane = 0;
  int size = 256;
  double field_of_view = 40;
  double distance = 3.5;
  int samples = 2;
  bool with_depth = false;

  void Check() const {
    const auto require = [](bool holds, const char* option, const char* remedy) {
      if (!holds) throw InvalidOption(option, "is out of range", remedy);
    };
    require(views >= 1 && views <= kMaxViews, "--views", "use 1 to 100000");
    require(size >= 8 && size <= 8192, "--size", "use 8 to 8192 pixels");
    require(field_of_view >= 1 && field_of_view <= 150, "--fov", "use 1 to 150 degrees");
    require(distance > 1 && distance <= 1000, "--distance", "use more than 1 object radius, at most 1000");
    require(samples >= 1 && samples <= 16, "--samples", "use 1 to 16");
    require(std::isfinite(in_plane), "--in-plane", "use degrees");
    for (const double elevation : elevations)
      require(std::abs(elevation) <= 90, "--elevations", "use -90 to 90 degrees");
    for (const double azimuth : azimuths) require(std::isfinite(azimuth), "--azimuths", "use degrees");
  }
};

/// Every azimuth with every elevation; without lists, evenly over the upper hemisphere.
std::vector<Viewpoint> ViewpointsOf(const RenderRequest& request) {
  std::vector<Viewpoint> viewpoints;
  if (request.azimuths.empty() && request.elevations.empty()) {
    for (const CanonicalDirection& direction : PredefinedViewpoints(request.views)) {
      viewpoints.push_back({DegreesFromRadians(direction.azimuth), DegreesFromRadians(direction.elevation),
                            request.in_plane, request.distance});
    }
    return viewpoints;
  }
  const auto or_zero = [](const std::vector<double>& list) { return list.empty() ? std::vector{0.0} : list; };
  for (const double elevation : or_zero(request.elevations))
    for (const double azimuth : or_zero(request.azimuths))
      viewpoints.push_back({azimuth, elevation, request.in_plane, request.distance});
  return viewpoints;
}

void SaveEncoded(const fs::path& path, const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(path.extension().string(), image, bytes)) throw Error(path.string(), "cannot be encoded");
  WriteFileAtomically(path, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

/// Colour with the coverage as alpha; partly covered pixels are mixed with white.
cv::Mat ToBgra(const Rendering& rendering) {
  cv::Mat bgra(rendering.image.size(), CV_8UC4);
  for (int y = 0; y < bgra.rows; ++y) {
    for (int x = 0; x < bgra.cols; ++x) {
      const auto& rgb = rendering.image.at<cv::Vec3b>(y, x);
      bgra.at<cv::Vec4b>(y, x) = {rgb[2], rgb[1], rgb[0], rendering.mask.at<std::uint8_t>(y, x)};
    }
  }
  return bgra;
}

Json RowsOf(const Eigen::Matrix3d& matrix) {
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({matrix(i, 0), matrix(i, 1), matrix(i, 2)});
  return rows;
}

class ViewWriter {
 public:
  ViewWriter(const RenderRequest& request, const Renderer& renderer, std::vector<Viewpoint> viewpoints)
      : request_(request),
        renderer_(renderer),
        viewpoints_(std::move(viewpoints)),
        camera_(PinholeCamera::FromFieldOfView(request.size, request.size, request.field_of_view)),
        thumbnails_(std::min<std::size_t>(kMaxThumbnails, viewpoints_.size())) {}

  void WriteAll(int threads, const ProgressCallback& progress) {
    std::vector<std::jthread> workers;
    for (int i = 0; i < threads; ++i) workers.emplace_back([&] { Work(progress); });
    workers.clear();
    if (failure_) std::rethrow_exception(failure_);
    SaveImage(Path("contact_sheet.png"), ContactSheet());
    WriteFileAtomically(Path("cameras.json"), PrettyJson(Cameras()) + "\n");
  }

 private:
  void Work(const ProgressCallback& progress) {
    try {
      for (std::size_t i = next_++; i < viewpoints_.size() && !has_failed_; i = next_++) {
        WriteView(i);
        const std::scoped_lock lock(mutex_);
        ++done_;
        progress({"rendering views", done_, static_cast<std::int64_t>(viewpoints_.size()), {}});
      }
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      if (!has_failed_.exchange(true)) failure_ = std::current_exception();
    }
  }

  void WriteView(std::size_t index) {
    const Rendering rendering = renderer_.Render(camera_, CameraFromObject(viewpoints_[index]),
                                                 {.samples_per_side = request_.samples});
    SaveEncoded(Path(Name(index) + ".png"), ToBgra(rendering));
    if (request_.with_depth) SaveEncoded(Path(Name(index) + "_depth.tiff"), rendering.depth);
    if (index >= thumbnails_.size()) return;
    cv::resize(rendering.image, thumbnails_[index], {kThumbnailSide, kThumbnailSide}, 0, 0,
               request_.size > kThumbnailSide ? cv::INTER_AREA : cv::INTER_CUBIC);
  }

  fs::path Path(const std::string& name) const { return fs::path(request_.out) / name; }
  static std::string Name(std::size_t index) { return Formatted("%03zu", index); }

  cv::Mat ContactSheet() const {
    constexpr int kCaption = 22;
    const int columns = static_cast<int>(std::ceil(std::sqrt(1.5 * static_cast<double>(thumbnails_.size()))));
    const int rows = (static_cast<int>(thumbnails_.size()) + columns - 1) / columns;
    cv::Mat sheet(rows * (kThumbnailSide + kCaption) + 8, columns * kThumbnailSide, CV_8UC3, kWhite);
    for (std::size_t i = 0; i < thumbnails_.size(); ++i) {
      const int left = static_cast<int>(i) % columns * kThumbnailSide;
      const int top = static_cast<int>(i) / columns * (kThumbnailSide + kCaption);
      thumbnails_[i].copyTo(sheet({left, top, kThumbnailSide, kThumbnailSide}));
      DrawText(sheet,
               Formatted("%s  az %.0f el %.0f", Name(i).c_str(), viewpoints_[i].azimuth, viewpoints_[i].elevation),
               {left + 8.0, top + kThumbnailSide + 14.0}, {.colour = kBlack, .height = 8});
    }
    return sheet;
  }

  Json Cameras() const {
    // This format counts pixel centres as integers.
    Eigen::Matrix3d intrinsics = camera_.Intrinsics();
    intrinsics(0, 2) -= 0.5;
    intrinsics(1, 2) -= 0.5;
    Json images = Json::array();
    for (std::size_t i = 0; i < viewpoints_.size(); ++i) {
      const Rigid3 pose = CameraFromObject(viewpoints_[i]);
      Json image = {{"file", Name(i) + ".png"},
                    {"mask", Name(i) + ".png"},
                    {"width", camera_.width},
                    {"height", camera_.height},
                    {"K", RowsOf(intrinsics)},
                    {"R", RowsOf(pose.rotation)},
                    {"t", {pose.translation.x(), pose.translation.y(), pose.translation.z()}},
                    {"azimuth_deg", viewpoints_[i].azimuth},
                    {"elevation_deg", viewpoints_[i].elevation}};
      if (request_.with_depth) image["depth"] = Name(i) + "_depth.tiff";
      images.push_back(image);
    }
    return {{"name", fs::path(request_.mesh).stem().string()},
            {"convention",
             "x_cam = R X + t (world to camera); OpenCV camera: x right, y down, z forward; pixel centres at "
             "integer coordinates; the mask is the alpha channel; world: the object, +Y up, in its unit sphere"},
            {"object", {{"centre", {0, 0, 0}}, {"radius", 1}, {"up", {0, 1, 0}}}},
            {"images", images}};
  }

  const RenderRequest& request_;
  const Renderer& renderer_;
  std::vector<Viewpoint> viewpoints_;
  PinholeCamera camera_;
  std::vector<cv::Mat> thumbnails_;
  std::atomic<std::size_t> next_ = 0;
  std::atomic<bool> has_failed_ = false;
  std::mutex mutex_;
  std::int64_t done_ = 0;
  std::exception_ptr failure_;
};

class RenderCommand : public Command {
 public:
  std::string Name() const override { return "render"; }
  std::string Summary() const override { return "Posed pictures of a mesh, with their cameras"; }
  std::string Example() const override {
    return "  antipode render chair.glb --out views --views 24 --depth\n"
           "  antipode render chair.glb --out turn --azimuths 0,45,90,135,180 --elevations 10,40";
  }

  void DeclareOptions(CLI::App& app) override {
    app.add_option("OBJECT", request_.mesh, "A mesh: glTF (.glb, .gltf) or what assimp reads")->required()
        ->type_name("FILE");
    app.add_option("--out", request_.out, "Folder for NNN.png, contact_sheet.png and cameras.json")->required()
        ->type_name("DIR");
    auto* views = app.add_option("--views", request_.views, "Views, evenly over the upper hemisphere")
                      ->capture_default_str()->type_name("N");
    app.add_option("--azimuths", request_.azimuths, "Or degrees about the vertical, 0 is the object's front (+Z)")
        ->delimiter(',')->excludes(views)->type_name("DEG,..");
    app.add_option("--elevations", request_.elevations, "with all of these degrees above the horizon")
        ->delimiter(',')->excludes(views)->type_name("DEG,..");
    app.add_option("--in-plane", request_.in_plane, "Roll of every camera about its optical axis, degrees")
        ->capture_default_str()->type_name("DEG");
    app.add_option("--size", request_.size, "Side of the square pictures, pixels")->capture_default_str()
        ->type_name("N");
    app.add_option("--fov", request_.field_of_view, "Field of view, degrees")->capture_default_str()
        ->type_name("DEG");
    app.add_option("--distance", request_.distance, "Camera to centre, object radii")->capture_default_str()
        ->type_name("R");
    app.add_option("--samples", request_.samples, "N x N rays a pixel")->capture_default_str()->type_name("N");
    app.add_flag("--depth", request_.with_depth, "Also write NNN_depth.tiff: 32 bit, object radii along the axis");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    request_.Check();
    Mesh mesh = LoadMesh(request_.mesh);
    mesh.Normalize();
    const Renderer renderer(std::move(mesh));
    const std::vector<Viewpoint> viewpoints = ViewpointsOf(request_);
    const auto start = std::chrono::steady_clock::now();
    {
      ProgressLine line(common_.ProgressMode());
      ViewWriter(request_, renderer, viewpoints).WriteAll(common_.ThreadCount(), [&](const Progress& progress) {
        ThrowIfInterrupted();
        line.Show(progress);
      });
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    Report(viewpoints.size(), seconds);
  }

 private:
  void Report(std::size_t views, double seconds) const {
    const double rate = static_cast<double>(views) / seconds;
    common_.WriteJson({{"out", request_.out}, {"views", views}, {"seconds", seconds}, {"views_per_second", rate}});
    if (!common_.PrintsText()) return;
    std::cout << Formatted("%zu views in %.2f s (%.1f views per second)\n", views, seconds, rate)
              << "Pictures and cameras.json: " << request_.out << "\n"
              << "All at a glance: " << (fs::path(request_.out) / "contact_sheet.png").string() << "\n";
  }

  RenderRequest request_;
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeRenderCommand() { return std::make_unique<RenderCommand>(); }

}  // namespace antipode
