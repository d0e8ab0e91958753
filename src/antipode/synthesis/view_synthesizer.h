#pragma once

#include <functional>
#include <span>
#include <string>

#include "antipode/synthesis/view_request.h"
#include "antipode/util/progress.h"

namespace antipode {

/// Shows an object from other viewpoints.
class ViewSynthesizer {
 public:
  virtual ~ViewSynthesizer() = default;

  /// What decides the views beside the requests: picture or mesh, model and settings.
  virtual std::string Fingerprint() const = 0;

  /// The camera of all its views.
  virtual SynthesisCamera Camera() const = 0;

  /// Calls `use` with each view, in the order of the requests, as soon as it is there.
  virtual void Synthesize(std::span<const ViewRequest> requests, const std::function<void(const SynthesizedView&)>& use,
                          const ProgressCallback& progress = {}) const = 0;
};

}  // namespace antipode
