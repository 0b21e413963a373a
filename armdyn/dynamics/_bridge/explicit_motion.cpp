// Explicit Runge-Kutta steps from sample to sample.
#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace armdyn {
namespace {

using Numbers = std::vector<double>;

constexpr int kMostHalvings = 48;  // per step: then its parts are of the size of rounding
// Largest step times the rate at which damping stops a joint. The error estimate of Dormand-Prince 8(5,3) for x' = -x / T
// is right to a factor of two up to a step of 5.2 T; at 5.65 T it vanishes, where the step itself is off by 0.25.
constexpr double kStiff = 5.0;

// Consecutive steps, from the state x and its rate.
class Stepper {
 public:
  Stepper(Arm& arm, const ExplicitMethod& method, double rtol)
      : arm_(arm), method_(method), rtol_(rtol), n_(arm.nv()), stages_(method.stages),
        K_((stages_ + 1) * 2 * n_), next_(2 * n_), stage_(2 * n_), torque_(n_), middle_(kMostHalvings * n_),
        x(2 * n_), rate(2 * n_) {}

  // Rate at x under a torque.
  void begin(const double* tau) { rate_of(x.data(), tau, rate.data()); }

  // Integrate over h under a linear torque. False: failed, with x in an undefined state.
  bool advance(double h, const double* first, const double* last, long& spare, int depth = 0) {
    if (step(h, first, last)) return true;
    spare -= static_cast<long>(stages_);
    if (spare < 0 || depth == kMostHalvings) return false;
    double* middle = &middle_[depth * n_];
    for (std::size_t i = 0; i < n_; ++i) middle[i] = first[i] + 0.5 * (last[i] - first[i]);
    return advance(h / 2, first, middle, spare, depth + 1) && advance(h / 2, middle, last, spare, depth + 1);
  }

 private:
  void rate_of(const double* state, const double* tau, double* out) {
    std::copy(state + n_, state + 2 * n_, out);
    arm_.acceleration(state, state + n_, tau, out + n_);
  }

  bool step(double h, const double* first, const double* last) {
    const std::size_t size = 2 * n_;
    std::copy(rate.begin(), rate.end(), K_.begin());
    for (std::size_t s = 1; s < stages_; ++s) {
      sum(h, &method_.A[s * stages_], s);
      for (std::size_t i = 0; i < n_; ++i) torque_[i] = first[i] + method_.c[s] * (last[i] - first[i]);
      rate_of(next_.data(), torque_.data(), &K_[s * size]);
    }
    stage_ = next_;
    sum(h, method_.b.data(), stages_);
    rate_of(next_.data(), last, &K_[stages_ * size]);
    if (!(error(h) < 1) || stiff(h)) return false;  // NaN, too
    std::copy(next_.begin(), next_.end(), x.begin());
    std::copy(K_.end() - static_cast<std::ptrdiff_t>(size), K_.end(), rate.begin());
    return true;
  }

  // next = x + h Σ weights_s K_s over the first rates.
  void sum(double h, const double* weights, std::size_t count) {
    const std::size_t size = 2 * n_;
    std::fill(next_.begin(), next_.end(), 0.0);
    for (std::size_t s = 0; s < count; ++s) {
      if (weights[s] == 0) continue;
      const double* k = &K_[s * size];
      for (std::size_t j = 0; j < size; ++j) next_[j] += weights[s] * k[j];
    }
    for (std::size_t j = 0; j < size; ++j) next_[j] = x[j] + h * next_[j];
  }

  double scale_of(std::size_t j) const { return rtol_ * (1e-2 + std::max(std::abs(x[j]), std::abs(next_[j]))); }

  // Stiffness detection, Hairer, Wanner, Solving ODEs II, IV.2: the last stage and the end are at one time, and their
  // difference gives the slope of the accelerations by the velocities. A difference within the tolerance gives none.
  bool stiff(double h) const {
    const std::size_t size = 2 * n_;
    double apart = 0, changed = 0;
    for (std::size_t j = n_; j < size; ++j) {
      const double moved = (next_[j] - stage_[j]) / scale_of(j);
      const double bent = (K_[stages_ * size + j] - K_[(stages_ - 1) * size + j]) / scale_of(j);
      apart += moved * moved;
      changed += bent * bent;
    }
    return apart > 100 * static_cast<double>(n_) && h * h * changed > kStiff * kStiff * apart;
  }

  // Hairer, Nørsett, Wanner, Solving ODEs I, II.10: the two embedded errors combined, relative to the tolerance.
  double error(double h) const {
    const std::size_t size = 2 * n_;
    double fine = 0, coarse = 0;
    for (std::size_t j = 0; j < size; ++j) {
      double fifth = 0, third = 0;
      for (std::size_t s = 0; s <= stages_; ++s) {
        fifth += method_.error5[s] * K_[s * size + j];
        third += method_.error3[s] * K_[s * size + j];
      }
      const double scale = scale_of(j);
      fine += fifth / scale * (fifth / scale);
      coarse += third / scale * (third / scale);
    }
    return fine == 0 ? 0.0 : std::abs(h) * fine / std::sqrt((fine + 0.01 * coarse) * static_cast<double>(size));
  }

  Arm& arm_;
  const ExplicitMethod& method_;
  double rtol_;
  std::size_t n_, stages_;
  Numbers K_, next_, stage_, torque_, middle_;

 public:
  Numbers x, rate;
};

void clip(const TorqueRange& range, const double* v, double* tau) {
  const std::size_t n = range.lower.size();
  for (std::size_t i = 0; i < n; ++i) {
    double lower = range.lower[i], upper = range.upper[i];
    for (std::size_t k = i; k < range.slopes.size(); k += n) {
      lower = std::max(lower, -range.rests[k] - range.slopes[k] * v[i]);
      upper = std::min(upper, range.rests[k] - range.slopes[k] * v[i]);
    }
    lower = std::min(lower, range.upper[i]);  // beyond the motor's no-load speed a joint can only brake
    upper = std::max(upper, range.lower[i]);
    tau[i] = std::min(std::max(tau[i], lower), upper);
  }
}

}  // namespace

std::vector<double> replay(Arm& arm, const ExplicitMethod& method, const SampledTorques& torques, std::vector<double> x,
                           double rtol, long spare) {
  const std::size_t n = arm.nv(), samples = torques.t.size();
  Stepper stepper(arm, method, rtol);
  stepper.x = std::move(x);
  Numbers states(stepper.x);
  states.reserve(samples * 2 * n);
  const double* last = nullptr;  // torque of the known rate at x
  for (std::size_t k = 0; k + 1 < samples; ++k) {
    if (!torques.jumps[k]) {
      const double *begin = &torques.tau[k * n], *end = &torques.tau_end[k * n];
      if (!last || !std::equal(begin, begin + n, last)) stepper.begin(begin);
      if (!stepper.advance(torques.t[k + 1] - torques.t[k], begin, end, spare)) break;
      last = end;
    }
    states.insert(states.end(), stepper.x.begin(), stepper.x.end());
  }
  return states;
}

std::vector<double> track(Arm& arm, const ExplicitMethod& method, SampledTorques& torques, const Tracking& tracking,
                          const TorqueRange& range, std::vector<double> x, double rtol, long spare) {
  const std::size_t n = arm.nv(), samples = torques.t.size();
  const double damping = 2 * tracking.bandwidth, stiffness = tracking.bandwidth * tracking.bandwidth;
  Stepper stepper(arm, method, rtol);
  stepper.x = std::move(x);
  Numbers states(stepper.x), feedback(n), led(n), M(n * n), before(2 * n), rate(2 * n);
  states.reserve(samples * 2 * n);
  bool known = false;  // whether the rate at x under the sample's torque is known
  for (std::size_t k = 0; k + 1 < samples; ++k) {
    if (torques.jumps[k]) {
      known = false;
    } else {
      const double *desired = &tracking.desired[k * 2 * n], *begin = &torques.tau[k * n];
      double* end = &torques.tau[(k + 1) * n];
      for (std::size_t i = 0; i < n; ++i)
        feedback[i] = damping * (stepper.x[n + i] - desired[n + i]) + stiffness * (stepper.x[i] - desired[i]);
      arm.inertia(stepper.x.data(), M.data());
      for (std::size_t i = 0; i < n; ++i) {
        double correction = 0;
        for (std::size_t j = 0; j < n; ++j) correction += M[i * n + j] * feedback[j];
        end[i] = led[i] = end[i] - tracking.fade[k] * correction;
      }
      clip(range, &stepper.x[n], end);
      if (!known) stepper.begin(begin);
      before = stepper.x;
      rate = stepper.rate;
      for (int round = 0; round <= tracking.clips; ++round) {
        if (round > 0) {
          std::copy(led.begin(), led.end(), end);
          clip(range, &stepper.x[n], end);
          stepper.x = before;
          stepper.rate = rate;
        }
        long left = spare;
        if (!stepper.advance(torques.t[k + 1] - torques.t[k], begin, end, left)) return states;
      }
      known = true;
    }
    states.insert(states.end(), stepper.x.begin(), stepper.x.end());
  }
  return states;
}

}  // namespace armdyn
