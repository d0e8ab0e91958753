#include "antipode/cli/pose_methods.h"

#include <algorithm>
#include <future>
#include <sstream>

#include "antipode/evaluation/baselines.h"
#include "antipode/matching/matchers.h"
#include "antipode/nn/device.h"
#include "antipode/prior/object_prior.h"
#include "antipode/util/error.h"
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
  auto matcher = std::async(std::launch::async, [&] { return LoadMatcher(request.matcher, request); });
  const auto prior = LoadPrior(request);
  return OnPhotographs("auto", [prior, matcher = matcher.get(), options = request.options](const auto& reference, const auto& query) {
    return EstimatePoseByBoth(*prior, *matcher, reference, query, options);
  });
}

std::vector<std::string> MethodNames() {
  std::vector<std::string> names{"auto", "prior", "matching"};
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

}  // namespace

void MethodRequest::Declare(CLI::App& app) {
  app.add_option("--method", method,
                 "auto: prior and matching together; prior: what the object looks like from all sides; matching: "
                 "only what both pictures show")
      ->capture_default_str()->type_name("NAME");
  app.add_option("--model", model, "The prior: name of a model (see 'antipode models list') or its folder")
      ->capture_default_str()->type_name("NAME|FOLDER");
  app.add_option("--matcher", matcher, JoinNames(MatcherNames()))->capture_default_str()->type_name("NAME");
}

PoseMethod LoadPoseMethod(const MethodRequest& request) {
  const std::string& name = request.method;
  if (name == "auto") return AutoMethod(request);
  if (name == "prior") return PriorMethod(request);
  if (name == "matching") return MatchingMethod(request.matcher, request);
  if (IsMatcher(name)) return MatchingMethod(name, request);
  if (name.starts_with(kPredictions)) return Predictions(name.substr(kPredictions.size()));
  for (const auto& [suffix, solver] : {std::pair{kPnp, DepthSolver::kPnp}, {kProcrustes, DepthSolver::kProcrustes}}) {
    const std::string matcher = name.substr(0, name.size() - std::min(suffix.size(), name.size()));
    if (name.ends_with(suffix) && IsMatcher(matcher)) return DepthBaseline(name, LoadMatcher(matcher, request), solver);
  }
  RefuseMethod(name);
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

}  // namespace antipode
