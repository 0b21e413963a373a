#include "lanes.hpp"
#include "program.hpp"

#include <algorithm>

namespace armdyn {
namespace {

// Memory layout of a form: c, r, then the slopes.
constexpr int kSlopes = 2;

ARMDYN_INLINE void add(const Lanes* x, const Lanes* y, Lanes* out, int n, double sign) {
  const Lanes centre = x[0] + sign * y[0], rest = x[1] + y[1];
  Lanes size = magnitude(centre);
  for (int k = kSlopes; k < kSlopes + n; ++k) {
    out[k] = x[k] + sign * y[k];
    size += magnitude(out[k]);
  }
  out[0] = centre;
  out[1] = rest + rounding(n + 2, size + rest);
}

ARMDYN_INLINE void multiply(const Lanes* x, const Lanes* y, Lanes* out, int n) {
  const Lanes a = x[0], b = y[0], rest_a = x[1], rest_b = y[1];
  Lanes far_a{}, far_b{}, middle{}, half{};
  for (int k = kSlopes; k < kSlopes + n; ++k) {
    const Lanes s = x[k], t = y[k], square = s * t;  // coefficient of ε_k², which is ½ ± ½
    far_a += magnitude(s);
    far_b += magnitude(t);
    middle += square;
    half += magnitude(square);
    out[k] = a * t + b * s;
  }
  far_a += rest_a;
  far_b += rest_b;
  const Lanes size_a = magnitude(a), size_b = magnitude(b);
  out[0] = a * b + middle * 0.5;
  out[1] = size_a * rest_b + size_b * rest_a + (far_a * far_b - half * 0.5) +
           rounding(2 * n + 8, (size_a + far_a) * (size_b + far_b));
}

struct Line {
  double centre, slope, rest;
};

// sin(x + phase) with x = c + d, |d| ≤ far, r of it the remainder: the least-squares line s d, and the range of the
// residual, whose extrema are at an end or where cos(x + phase) = s.
Line wave(double centre, double far, double rest, double phase) {
  const double pi = 3.14159265358979323846, middle = centre + phase;
  if (!(far < pi)) return {0, 0, 1 + rounding(64, 4 + std::abs(middle) + far)};
  // Small x separately: differences of nearly equal numbers would lose all digits.
  const double share = far < 1e-2 ? 1 - far * far / 10 : 3 * (std::sin(far) - far * std::cos(far)) / (far * far * far);
  const double slope = std::cos(middle) * share, stays = std::acos(std::clamp(slope, -1.0, 1.0));
  const double turns = 2 * pi * std::nearbyint(middle / (2 * pi));
  double lower = std::sin(middle - far) + slope * far, upper = lower;
  const auto leaves = [&](double d) {
    const double left = std::sin(middle + d) - slope * d;
    lower = std::min(lower, left);
    upper = std::max(upper, left);
  };
  leaves(far);
  for (const double side : {-1.0, 1.0})
    for (const int turn : {-1, 0, 1}) leaves(std::clamp(side * stays + turn * 2 * pi - (middle - turns), -far, far));
  return {(lower + upper) / 2, slope,
          (upper - lower) / 2 + std::abs(slope) * rest + rounding(64, 4 + std::abs(middle) + far)};
}

void wave(const Lanes* x, Lanes* out, int n, double phase) {
  for (int l = 0; l < kLanes; ++l) {
    double far = x[1][l];
    for (int k = kSlopes; k < kSlopes + n; ++k) far += std::abs(x[k][l]);
    const Line line = wave(x[0][l], far, x[1][l], phase);
    out[0][l] = line.centre;
    out[1][l] = line.rest;
    for (int k = kSlopes; k < kSlopes + n; ++k) out[k][l] = line.slope * x[k][l];
  }
}

ARMDYN_CLONES void run(const Program& program, const Lanes* given, Lanes* memory, Lanes* found) {
  const int n = program.inputs, width = kSlopes + n;
  for (const Instruction& step : program.instructions) {
    if (step.operation == Operation::output) {
      std::copy_n(memory + step.first * width, width, found + step.into * width);
      continue;
    }
    Lanes* out = memory + step.into * width;
    if (step.operation == Operation::input) {
      std::copy_n(given + step.first * width, width, out);
      continue;
    }
    const Lanes *x = memory + step.first * width, *y = memory + step.second * width;
    switch (step.operation) {
      case Operation::constant:
        std::fill_n(out, width, Lanes{});
        out[0] = all(step.value);
        break;
      case Operation::assign: std::copy_n(x, width, out); break;
      case Operation::negate:
        out[1] = x[1];
        out[0] = -x[0];
        for (int k = kSlopes; k < width; ++k) out[k] = -x[k];
        break;
      case Operation::twice:
        for (int k = 0; k < width; ++k) out[k] = x[k] + x[k];  // exact
        break;
      case Operation::square: multiply(x, x, out, n); break;
      case Operation::sine: wave(x, out, n, 0.0); break;
      case Operation::cosine: wave(x, out, n, 1.57079632679489661923); break;
      case Operation::add: add(x, y, out, n, 1.0); break;
      case Operation::subtract: add(x, y, out, n, -1.0); break;
      case Operation::multiply: multiply(x, y, out, n); break;
      default: break;
    }
  }
}

}  // namespace

void in_affine_forms(const Program& program, int boxes, const double* centre, const double* radius,
                     double* found_centre, double* found_slopes, double* found_rest) {
  const int n = program.inputs, width = kSlopes + n;
  Memory given(n * width), memory(program.places * width), found(program.outputs * width);
  for (int begin = 0; begin < boxes; begin += kLanes) {
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < kLanes; ++l) {
        const long at = static_cast<long>(i) * boxes + std::min(begin + l, boxes - 1);
        given[i * width][l] = centre[at];
        given[i * width + kSlopes + i][l] = radius[at];
      }
    run(program, given.data(), memory.data(), found.data());
    for (int i = 0; i < program.outputs; ++i)
      for (int l = 0; l < kLanes && begin + l < boxes; ++l) {
        const long at = static_cast<long>(i) * boxes + begin + l;
        const Lanes* form = found.data() + i * width;
        double far = std::abs(form[0][l]) + form[1][l];
        for (int k = kSlopes; k < width; ++k) far += std::abs(form[k][l]);
        const bool finite = far < HUGE_VAL;
        found_centre[at] = finite ? form[0][l] : 0.0;
        found_rest[at] = finite ? form[1][l] : HUGE_VAL;
        for (int k = 0; k < n; ++k)
          found_slopes[(static_cast<long>(i) * n + k) * boxes + begin + l] = finite ? form[kSlopes + k][l] : 0.0;
      }
  }
}

}  // namespace armdyn
