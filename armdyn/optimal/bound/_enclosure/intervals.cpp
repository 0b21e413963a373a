#include "lanes.hpp"
#include "program.hpp"

#include <algorithm>

namespace armdyn {
namespace {

struct Interval {
  Lanes lower, upper;
};

ARMDYN_INLINE Interval product(Interval x, Interval y) {
  const Lanes a = x.lower * y.lower, b = x.lower * y.upper, c = x.upper * y.lower, d = x.upper * y.upper;
  return {down(least(least(a, b), least(c, d))), up(most(most(a, b), most(c, d)))};
}

ARMDYN_INLINE Interval square(Interval x) {
  const Lanes near = most(most(x.lower, -x.upper), Lanes{}), far = most(magnitude(x.lower), magnitude(x.upper));
  return {most(down(near * near), Lanes{}), up(far * far)};
}

// Sine or cosine of [x[0], x[1]], with maxima at (2 k + phase) π and minima half a period later.
void wave(const Lanes* x, Lanes* out, double (*of)(double), double phase) {
  for (int l = 0; l < kLanes; ++l) {
    const double pi = 3.14159265358979323846, first = of(x[0][l]), last = of(x[1][l]);
    double a = x[0][l] / pi - phase, b = x[1][l] / pi - phase;
    const double room = kNear * (1 + std::max(std::abs(a), std::abs(b)));
    a -= room;
    b += room;
    const bool greatest = 2 * std::floor(b / 2) >= a, smallest = 2 * std::floor((b - 1) / 2) + 1 >= a;
    out[0][l] = smallest ? -1.0 : std::max(std::min(first, last) - kLibrary, -1.0);
    out[1][l] = greatest ? 1.0 : std::min(std::max(first, last) + kLibrary, 1.0);
  }
}

double sine(double x) { return std::sin(x); }
double cosine(double x) { return std::cos(x); }

ARMDYN_CLONES void run(const Program& program, const Lanes* given, Lanes* memory, Lanes* found) {
  for (const Instruction& step : program.instructions) {
    if (step.operation == Operation::output) {
      found[2 * step.into] = memory[2 * step.first];
      found[2 * step.into + 1] = memory[2 * step.first + 1];
      continue;
    }
    const Lanes* first = (step.operation == Operation::input ? given : memory) + 2 * step.first;
    const Interval x{first[0], first[1]}, y{memory[2 * step.second], memory[2 * step.second + 1]};
    Lanes* into = memory + 2 * step.into;
    Interval out{};
    switch (step.operation) {
      case Operation::constant: out = {all(step.value), all(step.value)}; break;
      case Operation::input:
      case Operation::assign: out = x; break;
      case Operation::negate: out = {-x.upper, -x.lower}; break;
      case Operation::twice: out = {x.lower + x.lower, x.upper + x.upper}; break;  // exact
      case Operation::square: out = square(x); break;
      case Operation::sine: wave(first, into, sine, 0.5); continue;
      case Operation::cosine: wave(first, into, cosine, 0.0); continue;
      case Operation::add: out = {down(x.lower + y.lower), up(x.upper + y.upper)}; break;
      case Operation::subtract: out = {down(x.lower - y.upper), up(x.upper - y.lower)}; break;
      case Operation::multiply: out = product(x, y); break;
      case Operation::output: break;
    }
    into[0] = out.lower;
    into[1] = out.upper;
  }
}

}  // namespace

void in_intervals(const Program& program, int boxes, const double* lower, const double* upper, double* found_lower,
                  double* found_upper) {
  Memory given(2 * program.inputs), memory(2 * program.places), found(2 * program.outputs);
  for (int begin = 0; begin < boxes; begin += kLanes) {
    for (int i = 0; i < program.inputs; ++i)
      for (int l = 0; l < kLanes; ++l) {
        const long at = static_cast<long>(i) * boxes + std::min(begin + l, boxes - 1);
        given[2 * i][l] = lower[at];
        given[2 * i + 1][l] = upper[at];
      }
    run(program, given.data(), memory.data(), found.data());
    for (int i = 0; i < program.outputs; ++i)
      for (int l = 0; l < kLanes && begin + l < boxes; ++l) {
        const long at = static_cast<long>(i) * boxes + begin + l;
        const double first = found[2 * i][l], last = found[2 * i + 1][l];
        found_lower[at] = first <= last ? first : -HUGE_VAL;  // also for NaN
        found_upper[at] = first <= last ? last : HUGE_VAL;
      }
  }
}

}  // namespace armdyn
