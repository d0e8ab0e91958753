#include "antipode/orientation/nearby_views.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "antipode/geometry/rotation.h"
#include "antipode/util/error.h"

namespace antipode {
namespace {

constexpr double kStepDeg = 10;
constexpr double kErrorCap = 8;  // pixels of 256: farther off is a wrong match, however far

Correspondences Swapped(Correspondences matches) {
  std::swap(matches.reference, matches.query);
  return matches;
}

/// A camera that has passed over a pole stands upright on the other side. The frame of this module is the canonical one
/// turned by a quarter about the vertical axis.
CanonicalDirection UprightDirection(double polar_deg, double azimuth_deg) {
  const bool beyond_pole = polar_deg < 0 || polar_deg > 180;
  const double polar = polar_deg < 0 ? -polar_deg : polar_deg > 180 ? 360 - polar_deg : polar_deg;
  return {RadiansFromDegrees(90 - polar), RadiansFromDegrees(azimuth_deg - 90 + (beyond_pole ? 180 : 0))};
}

using Projection = Eigen::Matrix<double, 3, 4>;

Projection ProjectionOf(const Rigid3& camera_from_object, const NearbyCameraModel& model) {
  Eigen::Matrix3d intrinsics;
  intrinsics << model.focal_length, 0, model.centre, 0, model.focal_length, model.centre, 0, 0, 1;
  return intrinsics * camera_from_object.Matrix();
}

/// Linear triangulation: the null vector of the four equations (x P_3 - P_1) X = 0, (y P_3 - P_2) X = 0.
Eigen::Vector4d Triangulate(const Projection& first, const Projection& second, const NearbyTrack& track) {
  Eigen::Matrix4d equations;
  equations.row(0) = track.in_first.x() * first.row(2) - first.row(0);
  equations.row(1) = track.in_first.y() * first.row(2) - first.row(1);
  equations.row(2) = track.in_second.x() * second.row(2) - second.row(0);
  equations.row(3) = track.in_second.y() * second.row(2) - second.row(1);
  return Eigen::JacobiSVD<Eigen::Matrix4d>(equations, Eigen::ComputeFullV).matrixV().col(3);
}

std::vector<NearbyTrack> TracksBetween(const Correspondences& pair, const Correspondences& to_third, double max_distance) {
  std::vector<NearbyTrack> tracks;
  if (to_third.reference.empty()) return tracks;
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const auto nearest = std::ranges::min_element(to_third.reference, {}, [&](const Eigen::Vector2d& point) {
      return (point - pair.reference[i]).squaredNorm();
    });
    if (!((*nearest - pair.reference[i]).norm() < max_distance)) continue;
    const auto index = static_cast<std::size_t>(nearest - to_third.reference.begin());
    tracks.push_back({pair.reference[i], pair.query[i], to_third.query[index], to_third.scores[index]});
  }
  return tracks;
}

/// Errors of the hypotheses at the given polar angles.
std::vector<TrackErrors> MeasurePolarAngles(const std::vector<NearbyTracks>& groups, const std::vector<double>& polar_angles,
                                            NearbyOrder order, const NearbyCameraModel& model) {
  std::vector<TrackErrors> errors;
  for (const double polar : polar_angles) errors.push_back(MeasureTracks(groups, HypotheticalCameras(polar, order, model), model));
  return errors;
}

std::vector<double> Published(const std::vector<TrackErrors>& errors) {
  std::vector<double> values;
  for (const TrackErrors& error : errors) values.push_back(error.published);
  return values;
}

}  // namespace

std::array<RelativeView, kNearbyViews> NearbyRequests(NearbyOrder order) {
  const RelativeView up{.polar = -kStepDeg}, down{.polar = kStepDeg}, left{.azimuth = -kStepDeg}, right{.azimuth = kStepDeg};
  if (order == NearbyOrder::kElevationStage) return {up, down, left, right};
  return {down, up, right, left};
}

std::array<Rigid3, kNearbyViews> HypotheticalCameras(double polar_deg, NearbyOrder order, const NearbyCameraModel& model) {
  std::array<Rigid3, kNearbyViews> cameras;
  const auto requests = NearbyRequests(order);
  for (int i = 0; i < kNearbyViews; ++i) {
    cameras[i] = CameraFromCanonical(UprightDirection(polar_deg + requests[i].polar, model.base_azimuth_deg + requests[i].azimuth),
                                     model.distance);
  }
  return cameras;
}

void NearbyMatches::Set(int first, int second, Correspondences correspondences) {
  matches_[first][second] = std::move(correspondences);
}

Correspondences NearbyMatches::Between(int first, int second) const {
  return first < second ? matches_[first][second] : Swapped(matches_[second][first]);
}

bool NearbyMatches::AnyEmpty() const {
  for (int first = 0; first < kNearbyViews; ++first)
    for (int second = first + 1; second < kNearbyViews; ++second)
      if (matches_[first][second].size() == 0) return true;
  return false;
}

std::vector<NearbyTracks> FindTracks(const NearbyMatches& matches, double max_distance_px) {
  std::vector<NearbyTracks> groups;
  for (int first = 0; first + 1 < kNearbyViews; ++first) {
    const Correspondences pair = matches.Between(first, first + 1);
    for (const int step : {2, 3}) {
      const int third = (first + step) % kNearbyViews;
      groups.push_back({first, first + 1, third, TracksBetween(pair, matches.Between(first, third), max_distance_px)});
    }
  }
  return groups;
}

TrackErrors MeasureTracks(const std::vector<NearbyTracks>& groups, const std::array<Rigid3, kNearbyViews>& cameras,
                          const NearbyCameraModel& model) {
  TrackErrors result;
  double capped = 0, count = 0;
  for (const NearbyTracks& group : groups) {
    const Projection first = ProjectionOf(cameras[group.first], model), second = ProjectionOf(cameras[group.second], model),
                     third = ProjectionOf(cameras[group.third], model);
    double sum = 0, weights = 0;
    for (const NearbyTrack& track : group.tracks) {
      const double error = ((third * Triangulate(first, second, track)).hnormalized() - track.in_third).norm();
      sum += track.weight * error;
      weights += track.weight;
      capped += std::min(error, kErrorCap);
    }
    if (weights > 0) result.published += sum / weights;
    if (group.tracks.empty()) {
      capped += kErrorCap;
      count += 1;
    }
    count += static_cast<double>(group.tracks.size());
    result.tracks += static_cast<int>(group.tracks.size());
  }
  result.robust = count > 0 ? capped / count : kErrorCap;
  return result;
}

PublishedSearch SearchAsPublished(const NearbyMatches& matches, NearbyOrder order, const NearbyCameraModel& model) {
  const std::vector<NearbyTracks> groups = FindTracks(matches);
  std::vector<double> coarse, fine;
  for (int polar = 11; polar <= 81; polar += 10) coarse.push_back(polar);
  PublishedSearch search;
  search.coarse_errors = Published(MeasurePolarAngles(groups, coarse, order, model));
  const auto best = std::ranges::min_element(search.coarse_errors) - search.coarse_errors.begin();
  search.coarse_polar_deg = static_cast<int>(coarse[best]);
  for (int polar = search.coarse_polar_deg - 10; polar < search.coarse_polar_deg + 10; ++polar) fine.push_back(polar);
  search.fine_errors = Published(MeasurePolarAngles(groups, fine, order, model));
  const auto finest = std::ranges::min_element(search.fine_errors) - search.fine_errors.begin();
  search.elevation_deg = 90 - static_cast<int>(fine[finest]);
  search.score = search.fine_errors[finest];
  return search;
}

double ParabolaOffset(double before, double at, double after) {
  const double curvature = before - 2 * at + after;
  return std::isfinite(curvature) && curvature > 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0;
}

ElevationEstimate SearchElevation(const NearbyMatches& matches, NearbyOrder order, const NearbyCameraModel& model) {
  constexpr double kLowest = -80, kHighest = 80, kStep = 2, kElsewhere = 20;
  const std::vector<NearbyTracks> groups = FindTracks(matches);
  std::vector<double> polar_angles;
  for (double elevation = kLowest; elevation <= kHighest; elevation += kStep) polar_angles.push_back(90 - elevation);
  const std::vector<TrackErrors> errors = MeasurePolarAngles(groups, polar_angles, order, model);
  if (errors.front().tracks == 0)
    throw Error("orientation", "no point is seen in three of the nearby views", "give --elevation, or another --matcher");
  const auto best = static_cast<std::size_t>(std::ranges::min_element(errors, {}, &TrackErrors::robust) - errors.begin());
  ElevationEstimate estimate;
  const bool inside = best > 0 && best + 1 < errors.size();
  const double offset = inside ? ParabolaOffset(errors[best - 1].robust, errors[best].robust, errors[best + 1].robust) : 0;
  estimate.elevation_deg = 90 - polar_angles[best] + offset * kStep;
  estimate.score = errors[best].robust;
  estimate.tracks = errors[best].tracks;
  estimate.margin = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < errors.size(); ++i)
    if (std::abs(polar_angles[i] - polar_angles[best]) >= kElsewhere)
      estimate.margin = std::min(estimate.margin, errors[i].robust - errors[best].robust);
  return estimate;
}

}  // namespace antipode
