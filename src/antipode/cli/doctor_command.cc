#include <torch/version.h>

#include <functional>
#include <iostream>
#include <opencv2/core/version.hpp>

#include "antipode/cli/command.h"
#include "antipode/cli/common_options.h"
#include "antipode/cli/processor.h"
#include "antipode/geometry/look_at.h"
#include "antipode/nn/device.h"
#include "antipode/pose/two_view_pose.h"
#include "antipode/render/renderer.h"
#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/formatted.h"
#include "antipode/util/version.h"
#include "antipode/weights/registry.h"

namespace antipode {
namespace {

using Json = nlohmann::ordered_json;

/// A box with a colour of its own on every side, so that no two views of it look alike.
Mesh ColouredBox() {
  Mesh mesh;
  mesh.materials.emplace_back();
  const Eigen::Vector3f half(0.6f, 0.9f, 0.4f);
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.f, 1.f}) {
      const Eigen::Vector3f normal = side * Eigen::Vector3f::Unit(axis);
      const Eigen::Vector3f across = Eigen::Vector3f::Unit((axis + 1) % 3);
      const Eigen::Vector3f along = normal.cross(across);
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      for (const auto& [a, b] : {std::pair{-1.f, -1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}}) {
        mesh.positions.push_back((normal + a * across + b * along).cwiseProduct(half));
        mesh.normals.push_back(normal);
        mesh.colors.push_back({axis == 0 ? 0.9f : 0.2f, side > 0 ? 0.8f : 0.1f, axis == 2 ? 0.9f : 0.3f * b + 0.3f});
      }
      for (const auto& [b, c] : {std::pair{1u, 2u}, {2u, 3u}}) {
        mesh.triangles.push_back({first, first + b, first + c});
        mesh.triangle_materials.push_back(0);
      }
    }
  }
  mesh.Normalize();
  return mesh;
}

ObjectPhotograph Photograph(const Renderer& renderer, double azimuth_deg) {
  const PinholeCamera camera = PinholeCamera::FromFieldOfView(256, 256, 40);
  const Rendering rendering =
      renderer.Render(camera, CameraFromObject({.azimuth = azimuth_deg, .elevation = 25, .distance = 3.5}));
  if (cv::countNonZero(rendering.mask) == 0) throw Error("renderer", "the test object is not seen");
  return {rendering.image, rendering.mask, camera};
}

/// Collects what was found out, line by line.
class Findings {
 public:
  explicit Findings(bool prints) : prints_(prints) {}

  void Tell(const std::string& name, const std::string& value) { Add("", name, value); }

  /// Runs a check that returns a short text and throws if it fails.
  void Check(const std::string& name, const std::function<std::string()>& check) {
    try {
      Add("ok", name, check());
    } catch (const std::exception& error) {
      const std::string text = error.what();
      Add("FAIL", name, text.substr(0, text.find('\n')));
      ++failures_;
    }
  }

  int failures() const { return failures_; }
  const Json& json() const { return json_; }

 private:
  void Add(const std::string& state, const std::string& name, const std::string& text) {
    json_.push_back({{"check", name}, {"state", state.empty() ? "info" : state}, {"text", text}});
    if (!prints_) return;
    std::cout << Formatted("%-5s %-18s %s\n", state.c_str(), name.c_str(), text.c_str()) << std::flush;
  }

  bool prints_;
  int failures_ = 0;
  Json json_ = Json::array();
};

class DoctorCommand : public Command {
 public:
  std::string Name() const override { return "doctor"; }
  std::string Summary() const override { return "What works on this machine, and why not"; }
  std::string Example() const override { return "  antipode doctor"; }
  void DeclareOptions(CLI::App& app) override {
    app.add_option("--model", model_, "Model to try")->capture_default_str()->type_name("NAME|FOLDER");
    common_.Declare(app);
  }

  void Run() override {
    common_.Apply();
    Findings findings(common_.PrintsText());
    TellMachine(findings);
    findings.Check("device", [&] { return "--device " + common_.device + " uses " + SelectDevice(common_.device).str(); });
    CheckModels(findings);
    CheckPipeline(findings);
    common_.WriteJson({{"antipode", Version()}, {"failures", findings.failures()}, {"checks", findings.json()}});
    if (findings.failures() > 0) {
      throw Error("doctor", Formatted("%d of the checks failed", findings.failures()),
                  "the lines that begin with FAIL say what to do");
    }
  }

 private:
  void TellMachine(Findings& findings) const {
    std::string features;
    for (const std::string& feature : ProcessorFeatures()) features += (features.empty() ? "" : ", ") + feature;
    findings.Tell("antipode", Version());
    findings.Tell("processor", ProcessorName() + (features.empty() ? "" : " (" + features + ")"));
    findings.Tell("threads", std::to_string(common_.ThreadCount()));
    findings.Tell("LibTorch", TORCH_VERSION);
    findings.Tell("CUDA", torch::cuda::is_available()
                              ? Formatted("%d devices", static_cast<int>(torch::cuda::device_count()))
                              : "no device; everything runs on the processor");
    findings.Tell("OpenCV", CV_VERSION);
    findings.Tell("models in", ModelsDirectory().string() + " and " + (UserDataDirectory() / "models").string());
  }

  static void CheckModels(Findings& findings) {
    std::vector<ModelEntry> entries;
    findings.Check("models", [&] {
      entries = ListModels();
      return std::to_string(entries.size()) + " found";
    });
    for (const ModelEntry& entry : entries) {
      findings.Check("model " + entry.name, [&] {
        VerifyModel(entry);
        return Formatted("%.1f MB, verified", 1e-6 * static_cast<double>(entry.bytes));
      });
    }
  }

  void CheckPipeline(Findings& findings) const {
    std::vector<ObjectPhotograph> photographs;
    findings.Check("rendering", [&]() -> std::string {
      const Renderer renderer(ColouredBox());
      for (const double azimuth : {20.0, 110.0}) photographs.push_back(Photograph(renderer, azimuth));
      return "two views of a box (Embree)";
    });
    if (photographs.size() != 2) return;
    findings.Check("pose", [&] {
      const ObjectPrior prior = ObjectPrior::Load(model_, SelectDevice(common_.device));
      const TwoViewPose pose = EstimatePose(prior, photographs[0], photographs[1]);
      double seconds = 0;
      for (const auto& [stage, stage_seconds] : pose.timings_s) seconds += stage_seconds;
      return Formatted("model %s, %zu hypotheses in %.0f ms", model_.c_str(), pose.hypotheses.size(), 1e3 * seconds);
    });
  }

  std::string model_ = "prior";
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> MakeDoctorCommand() { return std::make_unique<DoctorCommand>(); }

}  // namespace antipode
