#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "antipode/geometry/rigid3.h"
#include "antipode/geometry/viewpoints.h"
#include "antipode/matching/matcher.h"

/// Four views from ten degrees above, below, left and right of a picture, and what their correspondences say about the
/// elevation of the picture's camera: a camera that moves sideways circles the vertical axis, so its path depends on it.
/// Liu et al., "One-2-3-45", NeurIPS 2023, section 3.2; the paper's section 3.2.
namespace antipode {

inline constexpr int kNearbyViews = 4;

/// In which order the four views come. Both orders occur in the published program.
enum class NearbyOrder { kElevationStage, kInPlaneStage };

/// The changes of viewpoint, degrees.
std::array<RelativeView, kNearbyViews> NearbyRequests(NearbyOrder order);

/// Cameras looking at the origin whose intrinsics are known and whose distance is the unit of length.
struct NearbyCameraModel {
  double focal_length = 280;  ///< pixels; of Zero123's training views of 256 pixels
  double centre = 128;        ///< principal point, pixel centres at integers
  double distance = 1.2;
  double base_azimuth_deg = 30;  ///< of the picture; any would do
};

/// The four cameras if the picture was taken at this polar angle (degrees from the zenith).
std::array<Rigid3, kNearbyViews> HypotheticalCameras(double polar_deg, NearbyOrder order, const NearbyCameraModel& model = {});

/// Correspondences of all six pairs of the four views.
class NearbyMatches {
 public:
  /// @param first < second
  void Set(int first, int second, Correspondences correspondences);
  /// Any order.
  Correspondences Between(int first, int second) const;
  /// Whether some pair has none.
  bool AnyEmpty() const;

 private:
  std::array<std::array<Correspondences, kNearbyViews>, kNearbyViews> matches_;
};

/// A point seen in three views: matched between `first` and `second`, and from `first` to `third` at nearly the same pixel.
struct NearbyTrack {
  Eigen::Vector2d in_first, in_second, in_third;
  double weight = 1;  ///< the score of the match with the third view
};

/// The tracks of one start (0, 1, 2) and third view (start + 2, start + 3 modulo 4).
struct NearbyTracks {
  int first = 0, second = 0, third = 0;
  std::vector<NearbyTrack> tracks;
};

/// All six groups. They do not depend on the elevation.
std::vector<NearbyTracks> FindTracks(const NearbyMatches& matches, double max_distance_px = 1);

/// How badly tracks fit cameras: distances in the third view between a point and the projection of what is
/// triangulated (linearly) from the first two.
struct TrackErrors {
  double published = 0;  ///< sum over groups of the weighted means, pixels; a group without tracks counts nothing
  double robust = 0;     ///< mean over all tracks of min(error, cap), and the cap for every missing group
  int tracks = 0;
};
TrackErrors MeasureTracks(const std::vector<NearbyTracks>& groups, const std::array<Rigid3, kNearbyViews>& cameras,
                          const NearbyCameraModel& model = {});

/// The published search: polar angles 11, 21, .., 81, then p - 10 .. p + 9.
struct PublishedSearch {
  std::vector<double> coarse_errors, fine_errors;  ///< +infinity where the published program stops with an error
  int coarse_polar_deg = 0;
  int elevation_deg = 0;
  double score = 0;  ///< smallest fine error
};
PublishedSearch SearchAsPublished(const NearbyMatches& matches, NearbyOrder order, const NearbyCameraModel& model = {});

/// Where the parabola through three equally spaced values has its minimum, in steps from the middle one, -0.5 to 0.5.
double ParabolaOffset(double before, double at, double after);

/// The whole range of elevations, robust score, parabola through the minimum.
struct ElevationEstimate {
  double elevation_deg = 0;
  double score = 0;      ///< robust error at the minimum, pixels
  double margin = 0;     ///< by which the best elevation 20 degrees away is worse, pixels
  int tracks = 0;
};
/// @throws Error if no point is seen in three views
ElevationEstimate SearchElevation(const NearbyMatches& matches, NearbyOrder order, const NearbyCameraModel& model = {});

}  // namespace antipode
