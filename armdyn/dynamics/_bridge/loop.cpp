// Closed loop of an arm and a controller, tick by tick: measure, estimate, compute, saturate, integrate.
#include "loop.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

constexpr int kMostSteps = 20000;     // largest number of RK4 steps in one tick
constexpr double kShortest = 1e-6;    // shortest step, as a part of a tick
constexpr double kFade = 0.01;        // part of half a torque range over which a continuous integral is faded out
constexpr double kUnwind = 0.01;      // time constant of back calculation [s]
constexpr double kVelocityScale = 1000;  // tolerance of a velocity [rad/s] over that of a position [rad]

using Numbers = std::vector<double>;

// Row of a tick; the last row is repeated.
const double* row_of(const Numbers& table, std::size_t width, int tick) {
  return &table[std::min<std::size_t>(tick, table.size() / width - 1) * width];
}

// The loop between two ticks as ẋ = f(s, x), x = (q, v) or, continuous, (q, v, integral); s from 0 to 1 along the tick.
class Between {
 public:
  Between(const LoopProblem& problem, Callable& plant, Callable& law)
      : problem_(problem), plant_(plant), law_(law), nv_(problem.lower.size()),
        row_(problem.row_size), command_(nv_), tau(nv_) {}

  std::size_t size() const { return (problem_.continuous ? 3 : 2) * nv_; }

  void at(int tick) { tick_ = tick; }

  void slope(double s, const double* x, double* rate) {
    const double *q = x, *v = x + nv_;
    if (problem_.continuous) decide(s, x, rate + 2 * nv_);
    std::copy(v, v + nv_, rate);
    plant_.argument(0) = q;
    plant_.argument(1) = v;
    plant_.argument(2) = tau.data();
    plant_.argument(3) = problem_.plant_parameters.data();
    plant_(rate + nv_);
  }

  // Torque of the continuous controller, and the rates of its integrals.
  void decide(double s, const double* x, double* running) {
    const double *a = row_of(problem_.rows, problem_.row_size, tick_);
    const double *b = row_of(problem_.rows, problem_.row_size, tick_ + 1);
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] = a[i] + s * (b[i] - a[i]);
    const double *qa = row_of(problem_.q_reference, nv_, tick_), *qb = row_of(problem_.q_reference, nv_, tick_ + 1);
    law_.argument(0) = x;
    law_.argument(1) = x + nv_;
    law_.argument(2) = x + 2 * nv_;
    law_.argument(3) = nullptr;
    law_.argument(4) = row_.data();
    law_(command_.data());
    const bool runs = (tick_ + s) * problem_.period >= problem_.integrate_from;
    for (std::size_t i = 0; i < nv_; ++i) {
      tau[i] = std::min(std::max(command_[i], problem_.lower[i]), problem_.upper[i]);
      const double error = runs ? qa[i] + s * (qb[i] - qa[i]) - x[i] : 0.0, excess = command_[i] - tau[i];
      running[i] = error;
      if (problem_.antiwindup == Antiwindup::conditional && excess * error > 0) {
        // A hard switch would cause sliding along the limit.
        const double band = kFade * std::max(0.5 * (problem_.upper[i] - problem_.lower[i]), 1e-6);
        running[i] *= std::max(0.0, 1.0 - std::abs(excess) / band);
      } else if (problem_.antiwindup == Antiwindup::back_calculation && problem_.integral_gain[i] > 0) {
        running[i] -= excess / (problem_.integral_gain[i] * kUnwind);
      }
    }
  }

  const Numbers& command() const { return command_; }

 private:
  const LoopProblem& problem_;
  Callable &plant_, &law_;
  std::size_t nv_;
  int tick_ = 0;
  Numbers row_, command_;

 public:
  Numbers tau;  // applied torque [N m]
};

// Classical Runge-Kutta method over one tick, with step-size control by halving.
class Stepper {
 public:
  explicit Stepper(Between& between) : between_(between) {
    for (Numbers* x : {&coarse_, &middle_, &fine_, &k1_, &k2_, &k3_, &k4_, &probe_}) x->resize(between.size());
  }

  double shortest() const { return shortest_; }

  // False: the shortest step is not accurate enough, or values are not finite.
  bool tick(Numbers& x, double period, double tolerance, std::size_t nv) {
    double s = 0;
    for (int count = 0; s < 1; ++count) {
      const double part = std::min(part_, 1 - s);
      go(x, coarse_, s, part, period);
      go(x, middle_, s, part / 2, period);
      go(middle_, fine_, s + part / 2, part / 2, period);
      const double error = difference(tolerance, nv);
      if (!std::isfinite(error) || count > kMostSteps) {
        if (part < kShortest || count > kMostSteps) return false;
        part_ = part / 4;
      } else if (error > 1 && part > kShortest) {  // the shortest step crosses a torque's corner: negligible error
        part_ = part / 2;
      } else {
        shortest_ = std::min(shortest_, part);
        if (error < 1.0 / 64) part_ = std::min(1.0, 2 * part_);
        s += part;
        // Richardson extrapolation: the halves' error is a fifteenth of the difference.
        for (std::size_t j = 0; j < x.size(); ++j) x[j] = fine_[j] + (fine_[j] - coarse_[j]) / 15;
      }
    }
    return true;
  }

 private:
  void go(const Numbers& from, Numbers& to, double s, double part, double period) {
    const double h = part * period;
    between_.slope(s, from.data(), k1_.data());
    move(from, k1_, h / 2);
    between_.slope(s + part / 2, probe_.data(), k2_.data());
    move(from, k2_, h / 2);
    between_.slope(s + part / 2, probe_.data(), k3_.data());
    move(from, k3_, h);
    between_.slope(s + part, probe_.data(), k4_.data());
    for (std::size_t j = 0; j < to.size(); ++j) to[j] = from[j] + h / 6 * (k1_[j] + 2 * (k2_[j] + k3_[j]) + k4_[j]);
  }

  void move(const Numbers& from, const Numbers& rate, double h) {
    for (std::size_t j = 0; j < from.size(); ++j) probe_[j] = from[j] + h * rate[j];
  }

  double difference(double tolerance, std::size_t nv) const {
    double worst = 0;
    for (std::size_t j = 0; j < fine_.size(); ++j) {
      const double scale = tolerance * (j / nv == 1 ? kVelocityScale : 1.0) * (1.0 + std::abs(fine_[j]));
      const double error = std::abs(fine_[j] - coarse_[j]) / scale;
      if (!(error <= worst)) worst = error;  // NaN, too
    }
    return worst;
  }

  Between& between_;
  Numbers coarse_, middle_, fine_, k1_, k2_, k3_, k4_, probe_;
  double part_ = 1, shortest_ = 1;  // of a tick
};

// Measurements of the controller: encoders, and an estimated velocity.
class Sensors {
 public:
  Sensors(const LoopProblem& problem, Callable* model)
      : problem_(problem), model_(model), nv_(problem.lower.size()), q(problem.start.begin(), problem.start.begin() + nv_),
        v(problem.start.begin() + nv_, problem.start.end()), last_(nv_), acceleration_(nv_) {}

  // Measurement at a tick, from the state x and the torque of the tick before.
  void read(int tick, const Numbers& x, const Numbers& before) {
    const double h = problem_.period, p = problem_.pole;
    if (tick > 0 && problem_.velocity == Velocity::observer) predict(before);
    for (std::size_t i = 0; i < nv_; ++i) {
      const double y = rounded(x[i] + (problem_.noise.empty() ? 0.0 : problem_.noise[tick * nv_ + i]));
      if (problem_.velocity == Velocity::exact) {
        v[i] = x[nv_ + i];
        q[i] = y;
      } else if (tick == 0) {
        last_[i] = q[i] = y;
      } else if (problem_.velocity == Velocity::filtered) {
        v[i] = p * v[i] + (1 - p) * (y - last_[i]) / h;
        last_[i] = q[i] = y;
      } else {
        const double innovation = y - q[i];  // gains for a double pole at p
        q[i] += (1 - p * p) * innovation;
        v[i] += (1 - p) * (1 - p) / h * innovation;
      }
    }
  }

 private:
  double rounded(double position) const {
    return problem_.encoder > 0 ? std::nearbyint(position / problem_.encoder) * problem_.encoder : position;
  }

  void predict(const Numbers& before) {
    const double h = problem_.period;
    model_->argument(0) = q.data();
    model_->argument(1) = v.data();
    model_->argument(2) = before.data();
    model_->argument(3) = problem_.model_parameters.data();
    (*model_)(acceleration_.data());
    for (std::size_t i = 0; i < nv_; ++i) {
      q[i] += h * (v[i] + h / 2 * acceleration_[i]);
      v[i] += h * acceleration_[i];
    }
  }

  const LoopProblem& problem_;
  Callable* model_;
  std::size_t nv_;

 public:
  Numbers q, v;  // measured

 private:
  Numbers last_, acceleration_;
};

// Update the integral of a sampled controller after a tick.
void integrate(const LoopProblem& problem, double time, const double* q_reference, const Numbers& q,
               const Numbers& command, const Numbers& clipped, Numbers& integral) {
  if (time < problem.integrate_from - kUnwind * 1e-9) return;  // ticks are rounded sums
  for (std::size_t i = 0; i < q.size(); ++i) {
    const double error = q_reference[i] - q[i], excess = command[i] - clipped[i];
    if (problem.antiwindup == Antiwindup::conditional && excess * error > 0) continue;
    integral[i] += problem.period * error;
    if (problem.antiwindup == Antiwindup::back_calculation && problem.integral_gain[i] > 0)
      integral[i] -= std::min(1.0, problem.period / kUnwind) * excess / problem.integral_gain[i];
  }
}

bool within(const LoopProblem& problem, const Numbers& x) {
  const std::size_t nv = problem.lower.size();
  const double* goal = &problem.q_reference[problem.q_reference.size() - nv];
  for (std::size_t i = 0; i < nv; ++i)
    if (!(std::abs(x[i] - goal[i]) <= problem.away && std::abs(x[nv + i]) <= problem.fast)) return false;
  return true;
}

}  // namespace

LoopRun run_loop(const LoopProblem& problem, Callable& plant, Callable& law, Callable* model) {
  const std::size_t nv = problem.lower.size();
  Between between(problem, plant, law);
  Stepper stepper(between);
  Sensors sensors(problem, model);
  const std::size_t count = static_cast<std::size_t>(problem.ticks + 1) * nv;
  LoopRun run;
  for (Numbers* table : {&run.q, &run.v, &run.tau, &run.estimate}) table->resize(count);
  run.clipped.resize(static_cast<std::size_t>(problem.ticks) * nv);
  Numbers x(problem.start), pending(problem.first), command(nv), clipped(nv), integral(nv);
  x.resize(between.size());
  const auto record = [&](int k) {
    std::copy_n(x.begin(), nv, &run.q[k * nv]);
    std::copy_n(x.begin() + nv, nv, &run.v[k * nv]);
    std::copy_n(between.tau.begin(), nv, &run.tau[k * nv]);
    std::copy_n(sensors.v.begin(), nv, &run.estimate[k * nv]);
  };
  for (int k = 0; k < problem.ticks; ++k) {
    between.at(k);
    if (problem.continuous) {
      Numbers running(nv);
      between.decide(0.0, x.data(), running.data());
      sensors.v.assign(x.begin() + nv, x.begin() + 2 * nv);
      for (std::size_t i = 0; i < nv; ++i) run.clipped[k * nv + i] = between.command()[i] != between.tau[i];
    } else {
      sensors.read(k, x, between.tau);
      law.argument(0) = sensors.q.data();
      law.argument(1) = sensors.v.data();
      law.argument(2) = integral.data();
      law.argument(3) = pending.data();
      law.argument(4) = row_of(problem.rows, problem.row_size, k);
      law(command.data());
      for (std::size_t i = 0; i < nv; ++i) {
        clipped[i] = std::min(std::max(command[i], problem.lower[i]), problem.upper[i]);
        run.clipped[k * nv + i] = command[i] != clipped[i];
      }
      integrate(problem, k * problem.period, row_of(problem.q_reference, nv, k), sensors.q, command, clipped, integral);
      pending.insert(pending.end(), clipped.begin(), clipped.end());
      std::copy_n(pending.begin(), nv, between.tau.begin());
      pending.erase(pending.begin(), pending.begin() + nv);
    }
    record(k);
    if (!stepper.tick(x, problem.period, problem.tolerance, nv)) run.ended = Ended::failed;
    if (run.ended == Ended::whole && !within(problem, x)) run.ended = Ended::diverged;
    if (run.ended != Ended::whole) break;
    run.ticks = k + 1;
    record(k + 1);
  }
  run.shortest = stepper.shortest();
  return run;
}

}  // namespace armdyn
