#include "antipode/geometry/wigner.h"

#include <cmath>
#include <cstdlib>

namespace antipode {
namespace {

/// Recursion weights u, v, w of one matrix element.
struct Weights {
  double u, v, w;
};

Weights RecursionWeights(int l, int m, int n) {
  const int a = std::abs(m);
  const double zero = m == 0 ? 1 : 0;
  const double denominator = std::abs(n) == l ? 2.0 * l * (2 * l - 1) : double(l + n) * (l - n);
  return {std::sqrt((l + m) * (l - m) / denominator),
          0.5 * std::sqrt((1 + zero) * (l + a - 1) * (l + a) / denominator) * (1 - 2 * zero),
          -0.5 * std::sqrt(std::max(0, (l - a - 1) * (l - a)) / denominator) * (1 - zero)};
}

/// Where an element of degree l is in the stacked matrices.
constexpr int Index(int l, int m, int n) { return WignerOffset(l) + (m + l) * (2 * l + 1) + n + l; }

constexpr int kTabulatedDegree = 16;

/// Of all elements up to the tabulated degree, in the order of the stacked matrices: roots take longer than all the rest.
const std::vector<Weights>& TabulatedWeights() {
  static const std::vector<Weights> table = [] {
    std::vector<Weights> weights(WignerSize(kTabulatedDegree));
    for (int l = 1; l <= kTabulatedDegree; ++l)
      for (int m = -l; m <= l; ++m)
        for (int n = -l; n <= l; ++n) weights[Index(l, m, n)] = RecursionWeights(l, m, n);
    return weights;
  }();
  return table;
}

/// Fills the stacked Wigner matrices for one rotation (Scalar = double) or for a pack of rotations side
/// by side (Scalar = Eigen::Array). `first` holds D_1 with rows and columns in the order y, z, x.
template <typename Scalar>
class Recursion {
 public:
  Recursion(const Scalar (&first)[3][3], int max_degree, Scalar* stacked) : stacked_(stacked) {
    stacked_[0] = Scalar(first[0][0] * 0 + 1);
    if (max_degree == 0) return;
    for (int m = -1; m <= 1; ++m)
      for (int n = -1; n <= 1; ++n) At(1, m, n) = first[m + 1][n + 1];
    for (int l = 2; l <= max_degree; ++l)
      for (int m = -l; m <= l; ++m)
        for (int n = -l; n <= l; ++n) At(l, m, n) = Element(l, m, n);
  }

 private:
  Scalar& At(int l, int m, int n) { return stacked_[Index(l, m, n)]; }

  Scalar Product(int i, int l, int m, int n) {
    if (n == l) return At(1, i, 1) * At(l - 1, m, l - 1) - At(1, i, -1) * At(l - 1, m, 1 - l);
    if (n == -l) return At(1, i, 1) * At(l - 1, m, 1 - l) + At(1, i, -1) * At(l - 1, m, l - 1);
    return At(1, i, 0) * At(l - 1, m, n);
  }

  Scalar VTerm(int l, int m, int n) {
    using S = typename ScalarOf<Scalar>::type;
    if (m == 0) return Product(1, l, 1, n) + Product(-1, l, -1, n);
    if (m == 1) return Product(1, l, 0, n) * S(std::sqrt(2.0));
    if (m == -1) return Product(-1, l, 0, n) * S(std::sqrt(2.0));
    if (m > 0) return Product(1, l, m - 1, n) - Product(-1, l, 1 - m, n);
    return Product(1, l, m + 1, n) + Product(-1, l, -m - 1, n);
  }

  Scalar WTerm(int l, int m, int n) {
    if (m > 0) return Product(1, l, m + 1, n) + Product(-1, l, -m - 1, n);
    return Product(1, l, m - 1, n) - Product(-1, l, 1 - m, n);
  }

  Scalar Element(int l, int m, int n) {
    using S = typename ScalarOf<Scalar>::type;
    const Weights weights = l <= kTabulatedDegree ? table_[Index(l, m, n)] : RecursionWeights(l, m, n);
    Scalar sum = VTerm(l, m, n) * S(weights.v);
    if (weights.u != 0) sum += Product(0, l, m, n) * S(weights.u);
    if (weights.w != 0) sum += WTerm(l, m, n) * S(weights.w);
    return sum;
  }

  template <typename T>
  struct ScalarOf {
    using type = typename T::Scalar;
  };
  Scalar* stacked_;
  const std::vector<Weights>& table_ = TabulatedWeights();
};

template <>
template <>
struct Recursion<double>::ScalarOf<double> {
  using type = double;
};

/// Position of the harmonics Y_{1,-1}, Y_{1,0}, Y_{1,1} = (y, z, x) among the coordinates.
constexpr int kAxisOfOrder[3] = {1, 2, 0};

}  // namespace

Eigen::VectorXd WignerMatrices(const Eigen::Matrix3d& rotation, int max_degree) {
  double first[3][3];
  for (int m = 0; m < 3; ++m)
    for (int n = 0; n < 3; ++n) first[m][n] = rotation(kAxisOfOrder[m], kAxisOfOrder[n]);
  Eigen::VectorXd stacked(WignerSize(max_degree));
  Recursion<double>(first, max_degree, stacked.data());
  return stacked;
}

RowMajorMatrixXf WignerMatrices(std::span<const Eigen::Matrix3d> rotations, int max_degree) {
  constexpr int kLanes = 32;
  using Pack = Eigen::Array<float, kLanes, 1>;
  const int size = WignerSize(max_degree);
  RowMajorMatrixXf rows(rotations.size(), size);
  std::vector<Pack> stacked(size);
  for (std::size_t begin = 0; begin < rotations.size(); begin += kLanes) {
    const int count = static_cast<int>(std::min<std::size_t>(kLanes, rotations.size() - begin));
    Pack first[3][3];
    for (int m = 0; m < 3; ++m) {
      for (int n = 0; n < 3; ++n) {
        first[m][n].setZero();
        for (int i = 0; i < count; ++i)
          first[m][n][i] =
              static_cast<float>(rotations[begin + i](kAxisOfOrder[m], kAxisOfOrder[n]));
      }
    }
    Recursion<Pack>(first, max_degree, stacked.data());
    for (int k = 0; k < size; ++k)
      for (int i = 0; i < count; ++i) rows(begin + i, k) = stacked[k][i];
  }
  return rows;
}

std::array<Eigen::MatrixXd, 3> WignerGenerators(int degree) {
  const int size = 2 * degree + 1;
  Eigen::MatrixXd about_z = Eigen::MatrixXd::Zero(size, size);
  for (int m = 1; m <= degree; ++m) {
    about_z(degree + m, degree - m) = -m;
    about_z(degree - m, degree + m) = m;
  }
  // G_a = D(Q) G_z D(Q)^T where the cyclic permutation Q carries the z axis to the axis a.
  Eigen::Matrix3d x_from_z;
  x_from_z << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const auto turned = [&](const Eigen::Matrix3d& rotation) -> Eigen::MatrixXd {
    const Eigen::VectorXd stacked = WignerMatrices(rotation, degree);
    const auto block = WignerBlock(stacked, degree);
    return block * about_z * block.transpose();
  };
  return {turned(x_from_z), turned(x_from_z * x_from_z), about_z};
}

}  // namespace antipode
