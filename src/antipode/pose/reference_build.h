#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include "antipode/pose/reference.h"
#include "antipode/synthesis/view_synthesizer.h"

namespace antipode {

/// Makes the views that are not in `folder` yet, encodes them, and leaves a complete reference there. What was interrupted
/// goes on; a folder of other settings is refused.
/// @param folder empty: nothing is kept
/// @throws Error naming the folder if it holds another reference
Reference BuildReference(const ViewSynthesizer& synthesizer, std::span<const ViewRequest> requests, const ObjectPrior& prior,
                         const PriorIdentity& prior_identity, const std::optional<Rigid3>& source_from_object,
                         const std::filesystem::path& folder = {}, const ProgressCallback& progress = {});

}  // namespace antipode
