#include "antipode/geometry/spherical_harmonics.h"

#include <cmath>
#include <numbers>

namespace antipode {

Eigen::VectorXd SphericalHarmonics(const Eigen::Vector3d& direction, int max_degree) {
  Eigen::VectorXd values(SphericalHarmonicCount(max_degree));
  const double x = direction.x(), y = direction.y(), z = direction.z();
  const auto index = [](int l, int m) { return l * l + l + m; };

  // cosine = r^m cos(m phi) and sine = r^m sin(m phi) with r the distance from the z axis; the factor
  // r^m is taken out of the associated Legendre functions, so the poles need no special case.
  double cosine = 1, sine = 0;
  double diagonal = std::sqrt(1 / (4 * std::numbers::pi));
  for (int m = 0; m <= max_degree; ++m) {
    if (m > 0) {
      const double next_cosine = x * cosine - y * sine;
      sine = x * sine + y * cosine;
      cosine = next_cosine;
      diagonal *= std::sqrt((2.0 * m + 1) / (2.0 * m));
    }
    const double azimuthal_scale = m == 0 ? 1 : std::numbers::sqrt2;
    double before_previous = 0, previous = 0;
    for (int l = m; l <= max_degree; ++l) {
      double legendre = diagonal;
      if (l > m) {
        const double a = std::sqrt((4.0 * l * l - 1) / (double(l) * l - double(m) * m));
        const double b = std::sqrt(((l - 1.0) * (l - 1.0) - double(m) * m) /
                                   (4.0 * (l - 1.0) * (l - 1.0) - 1));
        legendre = a * (z * previous - b * before_previous);
      }
      values[index(l, m)] = azimuthal_scale * legendre * cosine;
      if (m > 0) values[index(l, -m)] = azimuthal_scale * legendre * sine;
      before_previous = previous;
      previous = legendre;
    }
  }
  return values;
}

}  // namespace antipode
