#include "antipode/cli/pose_methods.h"

#include <algorithm>
#include <exception>
#include <future>
#include <optional>
#include <sstream>

#include "antipode/evaluation/baselines.h"
#include "antipode/image/load.h"
#include "antipode/matching/matchers.h"
#include "antipode/matching/xfeat_matcher.h"
#include "antipode/nn/device.h"
#include "antipode/pose/object_pose.h"
#include "antipode/pose/two_way.h"
#include "antipode/prior/object_prior.h"
#include "antipode/util/error.h"
#include "antipode/util/formatted.h"
#include "antipode/util/interrupt.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"

namespace antipode {
namespace {

constexpr std::string_view kPredictions = "predictions=";
constexpr std::string_view kPnp = "+depth-pnp";
constexpr std::string_view kProcrustes = "+depth-procrustes";

std::shared_ptr<const ObjectPrior> LoadPrior(const MethodRequest& request) {
  return std::make_shared<const ObjectPrior>(ObjectPrior::Load(request.model, SelectDevice(request.device)));
}

std::shared_ptr<const Matcher> LoadMatcher(const std::string& name, const MethodRequest& request) {
  return MakeMatcher(name, SelectDevice(request.device));
}

PoseMethod PriorMethod(const MethodRequest& request) {
  return OnPhotographs("prior", [prior = LoadPrior(request), options = request.options](const auto& reference, const auto& query) {
    return EstimatePose(*prior, reference, query, options);
  });
}

PoseMethod MatchingMethod(const std::string& matcher_name, const MethodRequest& request) {
  return OnPhotographs(request.method, [matcher = LoadMatcher(matcher_name, request),
                                        options = request.options](const auto& reference, const auto& query) {
    return EstimatePoseByMatching(*matcher, reference, query, options);
  });
}

PoseMethod AutoMethod(const MethodRequest& request) {
  auto matcher = std::async(std::launch::async, [&] { return LoadMatcher(request.MatcherFor(request.method), request); });
  const auto prior = LoadPrior(request);
  return OnPhotographs("auto", [prior, matcher = matcher.get(), options = request.options](const auto& reference, const auto& query) {
    return EstimatePoseByBoth(*prior, *matcher, reference, query, options);
  });
}

/// Makes references, and keeps the last one: pairs come object by object.
class DiffusionRoute {
 public:
  DiffusionRoute(const MethodRequest& request, std::shared_ptr<const Matcher> matcher)
      : request_(request),
        models_(ReferenceModels::Load(request.model, request.device)),
        matcher_(std::move(matcher)),
        comparison_(request.comparison.Load(SelectDevice(request.device))) {
    request_.synthesis.device = request.device;
    if (!HasOwnMeshes()) request_.synthesis.Check();
  }

  TwoViewPose Estimate(const PairToEstimate& pair) {
    if (HasOwnMeshes()) return UpperBound(pair);
    if (!request_.synthesis.mesh.empty()) return AgainstMesh(pair);
    Keep(Sha256OfPicture(pair.reference.photograph.image), [&] {
      return BuildReference(request_.synthesis, models_, &pair.reference.photograph, {}, MakingViews());
    });
    return WithReferenceView(RelativeToSource(reference_, Pose(pair.query)), pair);
  }

 private:
  ProgressCallback MakingViews() const {
    return [report = request_.progress](const Progress& progress) {
      ThrowIfInterrupted();
      if (report) report(progress);
    };
  }
  bool HasOwnMeshes() const { return request_.synthesis.IsMesh() && request_.synthesis.mesh.empty() && !request_.object_meshes.empty(); }

  template <typename Build>
  void Keep(const std::string& key, const Build& build) {
    if (key == key_) return;
    reference_ = build();
    comparison_.Prepare(reference_);
    key_ = key;
  }

  ObjectPose Pose(const SceneView& view) {
    const ObjectPoseOptions options{.hypotheses = request_.options.hypotheses,
                                    .refine_iterations = request_.comparison.refine_iterations,
                                    .matching = request_.options.matching};
    ViewComparison* const comparison = request_.comparison.IsWanted() ? &comparison_ : nullptr;
    return EstimateObjectPose(reference_, {models_.prior.get(), matcher_.get(), comparison}, view.photograph, options);
  }

  TwoViewPose WithReferenceView(TwoViewPose pose, const PairToEstimate& pair) const {
    const ObjectPhotograph& photograph = pair.reference.photograph;
    pose.reference = MakeObjectView(photograph.image, photograph.mask, photograph.camera, models_.prior->ViewOptions());
    pose.warnings.insert(pose.warnings.begin(), reference_.warnings.begin(), reference_.warnings.end());
    return pose;
  }

  /// A perfect synthesiser knows how its views stand to its picture.
  TwoViewPose UpperBound(const PairToEstimate& pair) {
    Keep(pair.object, [&] {
      return BuildMeshReference(request_.object_meshes / (pair.object + ".glb"), request_.synthesis.views, models_);
    });
    reference_.source_from_object = pair.reference.camera_from_object;
    return WithReferenceView(RelativeToSource(reference_, Pose(pair.query)), pair);
  }

  TwoViewPose AgainstMesh(const PairToEstimate& pair) {
    Keep(request_.synthesis.mesh, [&] { return BuildReference(request_.synthesis, models_, nullptr, {}, MakingViews()); });
    return ComposeObjectPoses(Pose(pair.reference), Pose(pair.query));
  }

  MethodRequest request_;
  ReferenceModels models_;
  std::shared_ptr<const Matcher> matcher_;
  ViewComparison comparison_;
  Reference reference_;
  std::string key_;
};

PoseMethod DiffusionMethod(const MethodRequest& request) {
  auto route = std::make_shared<DiffusionRoute>(request, LoadMatcher(request.MatcherFor(request.method), request));
  return {"diffusion", [route](const PairToEstimate& pair) { return route->Estimate(pair); }};
}

PoseMethod InBothDirections(PoseMethod method) {
  const auto estimate = method.estimate;
  method.estimate = [estimate](const PairToEstimate& pair) {
    const PairToEstimate swapped{pair.object, pair.query, pair.reference};
    std::optional<TwoViewPose> forward, backward;
    std::exception_ptr failure;
    const auto attempt = [&](const PairToEstimate& direction, std::optional<TwoViewPose>& pose) {
      try {
        pose = estimate(direction);
      } catch (const Interrupted&) {
        throw;
      } catch (const Error&) {
        failure = std::current_exception();
      }
    };
    attempt(pair, forward);
    attempt(swapped, backward);
    if (forward && backward) return Reconcile(std::move(*forward), Swapped(std::move(*backward)));
    if (!forward && !backward) std::rethrow_exception(failure);
    TwoViewPose pose = forward ? std::move(*forward) : Swapped(std::move(*backward));
    pose.warnings.emplace_back("only one of the two directions gave a pose");
    return pose;
  };
  return method;
}

std::vector<std::string> MethodNames() {
  std::vector<std::string> names{"auto", "prior", "matching", "diffusion"};
  const std::vector<std::string> matchers = MatcherNames();
  names.insert(names.end(), matchers.begin(), matchers.end());
  return names;
}

bool IsMatcher(const std::string& name) {
  const std::vector<std::string> names = MatcherNames();
  return std::ranges::find(names, name) != names.end();
}

[[noreturn]] void RefuseMethod(const std::string& name) {
  const std::vector<std::string> names = MethodNames();
  const std::string nearest = NearestName(name, names);
  throw InvalidOption("--method", Quoted(name) + " is unknown",
                      nearest.empty() ? "use one of " + JoinNames(names) : "did you mean " + nearest + "?");
}

PoseMethod LoadOneWay(const MethodRequest& request) {
  const std::string& name = request.method;
  if (request.options.roll == CameraRoll::kLevel && name != "auto" && name != "prior")
    throw InvalidOption("--upright", "says nothing to the method " + Quoted(name), "use it with auto or prior");
  if (name == "auto") return AutoMethod(request);
  if (name == "prior") return PriorMethod(request);
  if (name == "diffusion") return DiffusionMethod(request);
  if (name == "matching") return MatchingMethod(request.MatcherFor(request.method), request);
  if (IsMatcher(name)) return MatchingMethod(name, request);
  if (name.starts_with(kPredictions)) return Predictions(name.substr(kPredictions.size()));
  for (const auto& [suffix, solver] : {std::pair{kPnp, DepthSolver::kPnp}, {kProcrustes, DepthSolver::kProcrustes}}) {
    const std::string matcher = name.substr(0, name.size() - std::min(suffix.size(), name.size()));
    if (name.ends_with(suffix) && IsMatcher(matcher)) return DepthBaseline(name, LoadMatcher(matcher, request), solver);
  }
  RefuseMethod(name);
}

}  // namespace

std::string MethodRequest::MatcherFor(const std::string& method_name) const {
  if (!matcher.empty()) return matcher;
  return method_name == "auto" ? kObjectLighterGlueModel : kXFeatLighterGlueModel;
}

void MethodRequest::Declare(CLI::App& app) {
  app.add_option("--method", method,
                 "auto: prior and matching together; prior: what the object looks like from all sides; matching: "
                 "only what both pictures show; diffusion: posed views of the object, imagined or rendered")
      ->capture_default_str()->type_name("NAME");
  app.add_option("--model", model, "The prior: name of a model (see 'antipode models list') or its folder")
      ->capture_default_str()->type_name("NAME|FOLDER");
  app.add_option("--matcher", matcher, JoinNames(MatcherNames()) + ", or the folder of a trained one; without: " + kObjectLighterGlueModel +
                                           " for auto, else " + kXFeatLighterGlueModel)
      ->type_name("NAME|FOLDER");
  app.add_flag("--two-way", two_way, "Estimate with the photographs swapped, too, and reconcile both; takes twice as long");
  app.add_flag_callback("--upright", [this] { options.roll = CameraRoll::kLevel; },
                        "The object stands upright and both cameras were held level: weighs the prior's hypotheses by how well they agree");
  synthesis.Declare(app, "For --method diffusion", "--reference-views");
  comparison.Declare(app, "For --method diffusion");
}

PoseMethod LoadPoseMethod(const MethodRequest& request) {
  PoseMethod method = LoadOneWay(request);
  return request.two_way ? InBothDirections(std::move(method)) : method;
}

std::vector<PoseMethod> LoadPoseMethods(const MethodRequest& request) {
  std::vector<PoseMethod> methods;
  std::istringstream names(request.method);
  for (std::string name; std::getline(names, name, ',');) {
    MethodRequest one = request;
    one.method = name;
    methods.push_back(LoadPoseMethod(one));
  }
  return methods;
}

std::vector<PoseMethod> LoadSweep(const MethodRequest& request, const std::string& what) {
  std::vector<PoseMethod> methods;
  const auto add = [&](const MethodRequest& one, const std::string& name) {
    methods.push_back(DiffusionMethod(one));
    methods.back().name = name;
  };
  if (what == "views") {
    for (const int views : {8, 16, 32, 64, 128}) {
      MethodRequest one = request;
      one.synthesis.views = views;
      add(one, Formatted("%d views", views));
    }
  } else if (what == "iterations") {
    if (!request.comparison.Refines()) throw InvalidOption("--sweep iterations", "has no refiner to iterate", "leave out --refiner none");
    for (int iterations = 0; iterations <= 3; ++iterations) {
      MethodRequest one = request;
      one.comparison.refine_iterations = iterations;
      add(one, Formatted("%d iterations", iterations));
    }
  } else {
    throw InvalidOption("--sweep", Quoted(what) + " is unknown", "use views or iterations");
  }
  return methods;
}

}  // namespace antipode
