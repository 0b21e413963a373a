// Closed loop of an arm and a controller, tick by tick.
#pragma once

#include "callable.hpp"

#include <vector>

namespace armdyn {

enum class Velocity { filtered, observer, exact };
enum class Antiwindup { conditional, back_calculation, none };
enum class Ended { whole, diverged, failed };

// Tables by rows; nv: joints, n: rows.
struct LoopProblem {
  std::vector<double> plant_parameters, model_parameters;  // p
  std::vector<double> rows, q_reference;      // (m, row_size), (n, nv); the last rows are repeated
  std::vector<double> start;                  // (q, v) or, continuous, (q, v, integral)
  std::vector<double> first;                  // torques of the first ticks, (delay, nv) [N m]
  std::vector<double> lower, upper;           // torque limits (nv) [N m]
  std::vector<double> integral_gain;          // (nv)
  std::vector<double> noise;                  // of the measurements, (ticks, nv) [rad]; empty: none
  double period = 1e-3, encoder = 0, pole = 0, integrate_from = 0;  // [s], [rad], [-], [s]
  double away = 100, fast = 1000;             // thresholds of divergence [rad], [rad/s]
  double tolerance = 1e-8;                    // of a tick's positions [rad]; times 1000 for velocities [rad/s]
  int ticks = 0, delay = 0, row_size = 1;
  Velocity velocity = Velocity::filtered;
  Antiwindup antiwindup = Antiwindup::conditional;
  bool continuous = false;
};

struct LoopRun {
  std::vector<double> q, v, tau, estimate;    // at each tick, (ticks + 1, nv); tau acts from there on
  std::vector<unsigned char> clipped;         // whether the torque was saturated, (ticks, nv)
  int ticks = 0;                              // number of finished ticks
  double shortest = 1;                        // shortest RK4 step, as a part of a tick
  Ended ended = Ended::whole;
};

// plant and model: a(q, v, tau, p); model: the observer's, or null. law: tau(q, v, integral, pending, row).
LoopRun run_loop(const LoopProblem& problem, Callable& plant, Callable& law, Callable* model);

}  // namespace armdyn
