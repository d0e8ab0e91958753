#pragma once

#include <string>

#include <opencv2/core.hpp>

#include "antipode/pose/view_matching.h"

namespace antipode {

/// Both crops side by side, the query turned as it was matched (8UC3, RGB, white background). Consistent matches
/// are lines in the colours of their places in the reference, so that neighbours can be followed; the others are
/// faint grey. Below, how many there are and what they give.
cv::Mat DrawMatchPicture(const ObjectView& reference, const ObjectView& query, const MatchedViews& matched);

}  // namespace antipode
