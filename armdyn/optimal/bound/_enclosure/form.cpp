#include "form.hpp"

#include "lanes.hpp"

#include <algorithm>
#include <vector>

namespace armdyn {
namespace {

constexpr double kLeast = 1e-300;  // smaller squares count as zero, like underflow

// Middle of an interval, and an upper bound of its radius.
struct Ball {
  double centre, radius;
};

inline Ball ball(const Table& table, long at) {
  const double lower = table.lower[at], upper = table.upper[at];
  const double centre = std::min(std::max(lower / 2 + upper / 2, lower), upper), far = std::max(upper - centre, centre - lower);
  return {centre, lower == upper ? 0.0 : std::nextafter(far, HUGE_VAL)};
}

inline double magnitude(const Table& table, long at) {
  return std::max(std::abs(table.lower[at]), std::abs(table.upper[at]));
}

// Adds values[size] + factor_v for v at its lower, then at its upper end: doubles the corners.
ARMDYN_INLINE void spread(double* values, long size, double at_lower, double at_upper) {
  for (long c = 0; c < size; ++c) values[size + c] = values[c] + at_upper;
  for (long c = 0; c < size; ++c) values[c] += at_lower;
}

// One box and one column. In the index of a corner the first joint's end is the highest bit: the corners of the last
// joints alone come first, and each joint before doubles their number.
class Corners {
 public:
  explicit Corners(int n)
      : n_(n), size_(1L << n), form_(size_), slope_(size_), sums_(size_), beside_(size_), most_(size_) {}

  // linear[n], squares of a > b row by row, turning[n][n] or null, weight[n]; ends of v.
  void fill(const double* linear, const double* squares, const double* turning, const double* weight,
            const double* lower, const double* upper);
  // Maximum of sign times form minus Σ concave v² over the box, with own squares Σ square v² added if convex.
  double greatest(double sign, const double* own, const double* lower, const double* upper);

 private:
  int n_;
  long size_;
  std::vector<double> form_, slope_, sums_, beside_, most_;
};

ARMDYN_CLONES void fill_corners(int n, const double* linear, const double* squares, const double* turning,
                                const double* weight, const double* lower, const double* upper,
                                double* __restrict form, double* __restrict slope, double* __restrict sums,
                                double* __restrict remainder) {
  const long size = 1L << n;
  // Σ linear_j v_j + Σ_{i > j} squares_ij v_i v_j: joint j adds v_j times its factor by the joints after it.
  form[0] = 0;
  long count = 1;
  for (int j = n - 1; j >= 0; --j, count *= 2) {
    sums[0] = linear[j];
    long part = 1;
    for (int i = n - 1; i > j; --i, part *= 2) {
      const double s = squares[i * (i + 1) / 2 + j];
      spread(sums, part, s * lower[i], s * upper[i]);
    }
    for (long c = 0; c < count; ++c) form[count + c] = form[c] + upper[j] * sums[c];
    for (long c = 0; c < count; ++c) form[c] += lower[j] * sums[c];
  }
  // Σ_k |weight_k + turning_k' v|.
  std::fill_n(remainder, size, 0.0);
  for (int k = 0; k < n; ++k) {
    if (!turning) {
      const double w = std::abs(weight[k]);
      for (long c = 0; c < size; ++c) remainder[c] += w;
      continue;
    }
    slope[0] = weight[k];
    count = 1;
    for (int j = n - 1; j >= 0; --j, count *= 2)
      spread(slope, count, turning[k * n + j] * lower[j], turning[k * n + j] * upper[j]);
    for (long c = 0; c < size; ++c) remainder[c] += std::abs(slope[c]);
  }
}

// A chord minus c v² has its maximum at an end or where 2 c v is the chord's slope. An error δ of that place costs
// c δ², of second order in the unit roundoff: only the rounding of some 16 operations per joint matters.
ARMDYN_CLONES double greatest_of(int n, double sign, const double* own, const double* lower, const double* upper,
                                 const double* __restrict form, const double* __restrict remainder,
                                 double* __restrict most, double* __restrict sums) {
  const long size = 1L << n;
  sums[0] = 0;
  long count = 1;
  for (int j = n - 1; j >= 0; --j, count *= 2) {
    const double c = std::max(sign * own[j], 0.0);
    spread(sums, count, c * (lower[j] * lower[j]), c * (upper[j] * upper[j]));
  }
  for (long c = 0; c < size; ++c) most[c] = sign * form[c] + sums[c] + remainder[c];
  count = size / 2;
  for (int j = 0; j < n; ++j, count /= 2) {
    const double c = std::max(-sign * own[j], 0.0), l = lower[j], u = upper[j];
    if (c == 0) {
      for (long i = 0; i < count; ++i) most[i] = std::max(most[i], most[count + i]);
      continue;
    }
    const double wide = u - l, bend = 2 * c * (wide * wide), over = std::max(bend, kLeast), shift = 2 * c * wide * l;
    const double at_lower = c * (l * l), at_upper = c * (u * u);
    for (long i = 0; i < count; ++i) {
      const double first = most[i], last = most[count + i], rise = last - first;
      const double share = std::min(std::max(rise - shift, 0.0), bend) / over, v = l + share * wide;
      const double between = first + share * rise - c * (v * v);
      most[i] = std::max(between, std::max(first - at_lower, last - at_upper));
    }
  }
  return most[0];
}

void Corners::fill(const double* linear, const double* squares, const double* turning, const double* weight,
                   const double* lower, const double* upper) {
  fill_corners(n_, linear, squares, turning, weight, lower, upper, form_.data(), slope_.data(), sums_.data(),
               beside_.data());
}

double Corners::greatest(double sign, const double* own, const double* lower, const double* upper) {
  return greatest_of(n_, sign, own, lower, upper, form_.data(), beside_.data(), most_.data(), sums_.data());
}

// Centres of a table's column, and the remainder: radii or magnitudes, and rounding.
struct Reading {
  int terms;
  bool tried;
  double remainder = 0;

  void take(const Table& table, long at, long stride, int count, const double* size, double* centres) {
    double radii = 0, sizes = 0;
    for (int i = 0; i < count; ++i) {
      const Ball one = ball(table, at + i * stride);
      centres[i] = one.centre;
      radii += size[i] * (tried ? one.radius : one.radius + std::abs(one.centre));
      sizes += size[i] * magnitude(table, at + i * stride);
    }
    remainder += radii + rounding(terms, sizes);
  }
};

}  // namespace

void range_of(const Form& form, double* lower, double* upper) {
  const int n = form.n, pairs = n * (n + 1) / 2, terms = 4 * n * n + 2 * pairs + 16 * n;
  const long many = form.many;
  Corners corners(form.corners ? n : 0);
  std::vector<double> linear(n), squares(pairs), turning(n * n), weight(n), own(n);
  std::vector<double> most(n), most_pairs(pairs), most_turned(n * n), ones(n, 1.0);
  for (long box = 0; box < form.boxes; ++box) {
    const double *v_lower = form.v.lower + box * n, *v_upper = form.v.upper + box * n;
    for (int i = 0; i < n; ++i) most[i] = std::max(std::abs(v_lower[i]), std::abs(v_upper[i]));
    for (int a = 0, p = 0; a < n; ++a)
      for (int b = 0; b <= a; ++b, ++p) most_pairs[p] = most[a] * most[b];
    for (int k = 0; k < n; ++k) std::copy(most.begin(), most.end(), most_turned.begin() + k * n);
    for (long m = 0; m < many; ++m) {
      Reading reading{terms, form.corners};
      reading.take(form.linear, box * n * many + m, many, n, most.data(), linear.data());
      reading.take(form.squares, box * pairs * many + m, many, pairs, most_pairs.data(), squares.data());
      Reading at_rest{terms, true};  // ε_k at its largest magnitude instead of its corners
      at_rest.take(form.weight, box * n * many + m, many, n, ones.data(), weight.data());
      if (form.turning.lower)
        reading.take(form.turning, box * n * n * many + m, many, n * n, most_turned.data(), turning.data());
      const double remainder = reading.remainder + at_rest.remainder;
      for (int a = 0; a < n; ++a) own[a] = squares[a * (a + 1) / 2 + a];
      double ends[2] = {0, 0};
      if (form.corners) {
        corners.fill(linear.data(), squares.data(), form.turning.lower ? turning.data() : nullptr, weight.data(),
                     v_lower, v_upper);
        for (const int side : {0, 1}) ends[side] = corners.greatest(side ? 1.0 : -1.0, own.data(), v_lower, v_upper);
      } else {
        for (int k = 0; k < n; ++k) ends[0] += std::abs(weight[k]);
        ends[1] = ends[0];
      }
      lower[box * many + m] = -(ends[0] + remainder);
      upper[box * many + m] = ends[1] + remainder;
    }
  }
}

}  // namespace armdyn
