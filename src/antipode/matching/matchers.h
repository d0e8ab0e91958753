#pragma once

#include <memory>
#include <string>
#include <vector>

#include <torch/torch.h>

#include "antipode/matching/matcher.h"

namespace antipode {

/// "xfeat-lighterglue", "object-lighterglue", "xfeat", "xfeat-star" (semi-dense), "loftr", "sift".
std::vector<std::string> MatcherNames();

/// A name, or the folder of a LighterGlue that `antipode train matcher` wrote.
///
/// Loads the matcher's weights: shipped ones (XFeat, LighterGlue) or an imported one (LoFTR); SIFT has none.
/// @throws InvalidOption if the name is unknown; Error saying what to import where a model is missing
std::unique_ptr<Matcher> MakeMatcher(const std::string& name, torch::Device device = torch::kCPU);

}  // namespace antipode
