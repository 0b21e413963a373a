// Predictor-corrector method of S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM
// Journal on Optimization 2(4), 1992, for boxes. In boxes any multipliers y are feasible: with x = lower + width z the
// multipliers of z >= 0 and z <= 1 are chosen such that s - t = cost - A' y. Each iterate thus gives a dual bound.
#include "linear_program.hpp"

#include "../../curves/_curves/profile.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

using Numbers = std::vector<double>;

constexpr double kBack = 0.995;   // fraction to the boundary of a step
constexpr double kLeast = 1e-30;  // pivot that counts as zero

class Method {
 public:
  explicit Method(const LinearProgram& program);
  LinearSolution run();

 private:
  void times(const Numbers& z, Numbers& out) const;
  Numbers transposed(const Numbers& y) const;
  void begin();
  void factorise();
  void direction();
  double room(const Numbers& value, const Numbers& change) const;
  double least_cost() const;

  const LinearProgram& p_;
  const int m_, n_;
  Numbers value_, right_, cost_;  // of z
  double fixed_ = 0.0;            // cost at z = 0
  Profile matrix_;
  Numbers y_, z_, w_, s_, t_, dy_, dz_, dw_, ds_, dt_;  // w = 1 - z
  Numbers missing_, weight_, low_, high_;               // low_, high_: centring of z s and w t
};

std::vector<int> profile_of(const LinearProgram& p) {
  std::vector<int> first(p.rows);
  for (int i = 0; i < p.rows; ++i) first[i] = i;
  for (int j = 0; j < p.columns; ++j)
    for (int e = p.start[j]; e < p.start[j + 1]; ++e) first[p.row[e]] = std::min(first[p.row[e]], p.row[p.start[j]]);
  return first;
}

Method::Method(const LinearProgram& p)
    : p_(p), m_(p.rows), n_(p.columns), value_(p.value, p.value + p.start[p.columns]), right_(p.right, p.right + p.rows),
      cost_(p.columns), matrix_(profile_of(p)) {
  for (Numbers* each : {&y_, &dy_, &missing_}) each->assign(m_, 0.0);
  for (Numbers* each : {&z_, &w_, &s_, &t_, &dz_, &dw_, &ds_, &dt_, &weight_, &low_, &high_}) each->assign(n_, 0.0);
  for (int j = 0; j < n_; ++j) {
    const double width = p.upper[j] - p.lower[j];
    for (int e = p.start[j]; e < p.start[j + 1]; ++e) {
      right_[p.row[e]] -= value_[e] * p.lower[j];
      value_[e] *= width;
    }
    cost_[j] = p.cost[j] * width;
    fixed_ += p.cost[j] * p.lower[j];
  }
}

void Method::times(const Numbers& z, Numbers& out) const {
  std::fill(out.begin(), out.end(), 0.0);
  for (int j = 0; j < n_; ++j)
    for (int e = p_.start[j]; e < p_.start[j + 1]; ++e) out[p_.row[e]] += value_[e] * z[j];
}

Numbers Method::transposed(const Numbers& y) const {
  Numbers out(n_, 0.0);
  for (int j = 0; j < n_; ++j)
    for (int e = p_.start[j]; e < p_.start[j + 1]; ++e) out[j] += value_[e] * y[p_.row[e]];
  return out;
}

// Middle of the box, and multipliers with equal complementarity products.
void Method::begin() {
  double largest = 0.0;
  for (const double each : cost_) largest = std::max(largest, std::abs(each));
  const double centre = 0.1 * largest;
  for (int j = 0; j < n_; ++j) {
    const double both = std::sqrt(cost_[j] * cost_[j] + 4 * centre * centre);
    z_[j] = w_[j] = 0.5;
    s_[j] = (both + cost_[j]) / 2;
    t_[j] = (both - cost_[j]) / 2;
  }
}

void Method::factorise() {
  matrix_.clear();
  for (int j = 0; j < n_; ++j) {
    weight_[j] = 1.0 / (s_[j] / z_[j] + t_[j] / w_[j]);
    for (int e = p_.start[j]; e < p_.start[j + 1]; ++e) {
      double* own = matrix_.row(p_.row[e]);
      const double scaled = weight_[j] * value_[e];
      for (int f = p_.start[j]; f <= e; ++f) own[p_.row[f]] += scaled * value_[f];
    }
  }
  matrix_.factorise(kLeast);
}

// Newton direction to centred z s and w t, and to feasible rows.
void Method::direction() {
  for (int j = 0; j < n_; ++j) dz_[j] = weight_[j] * (low_[j] / z_[j] - high_[j] / w_[j]);
  times(dz_, dy_);
  for (int i = 0; i < m_; ++i) dy_[i] = missing_[i] - dy_[i];
  matrix_.solve(dy_.data());
  const Numbers along = transposed(dy_);
  for (int j = 0; j < n_; ++j) {
    dz_[j] += weight_[j] * along[j];
    dw_[j] = -dz_[j];
    ds_[j] = (low_[j] - s_[j] * dz_[j]) / z_[j];
    dt_[j] = (high_[j] - t_[j] * dw_[j]) / w_[j];
  }
}

double Method::room(const Numbers& value, const Numbers& change) const {
  double step = 1.0;
  for (int j = 0; j < n_; ++j)
    if (change[j] < 0) step = std::min(step, -kBack * value[j] / change[j]);
  return step;
}

double Method::least_cost() const {
  double sum = fixed_;
  for (int i = 0; i < m_; ++i) sum += right_[i] * y_[i];
  const Numbers along = transposed(y_);
  for (int j = 0; j < n_; ++j) sum += std::min(0.0, cost_[j] - along[j]);
  return sum;
}

LinearSolution Method::run() {
  begin();
  LinearSolution best;
  best.cost = -INFINITY;
  for (int k = 0; k <= p_.most; ++k) {
    const double proven = least_cost();
    if (!std::isfinite(proven)) break;
    best.iterations = k;
    if (proven > best.cost) {
      best.cost = proven;
      best.multipliers = y_;
    }
    // The cost of z, corrected for infeasible rows, exceeds the multipliers' dual bound by `gap`.
    times(z_, missing_);
    double gained = 0.0, gap = 0.0;
    for (int i = 0; i < m_; ++i) {
      missing_[i] = right_[i] - missing_[i];
      gained += std::abs(y_[i] * missing_[i]);
    }
    for (int j = 0; j < n_; ++j) gap += z_[j] * s_[j] + w_[j] * t_[j];
    best.found = gap + gained < p_.tolerance * (1 + std::abs(proven));
    if (best.found || k == p_.most) break;

    factorise();
    for (int j = 0; j < n_; ++j) {
      low_[j] = -z_[j] * s_[j];
      high_[j] = -w_[j] * t_[j];
    }
    direction();
    double a = std::min(room(z_, dz_), room(w_, dw_)), b = std::min(room(s_, ds_), room(t_, dt_)), after = 0.0;
    for (int j = 0; j < n_; ++j)
      after += (z_[j] + a * dz_[j]) * (s_[j] + b * ds_[j]) + (w_[j] + a * dw_[j]) * (t_[j] + b * dt_[j]);
    const double target = gap / (2 * n_) * std::pow(std::max(after, 0.0) / gap, 3);
    for (int j = 0; j < n_; ++j) {
      low_[j] += target - dz_[j] * ds_[j];
      high_[j] += target - dw_[j] * dt_[j];
    }
    direction();
    a = std::min(room(z_, dz_), room(w_, dw_));
    b = std::min(room(s_, ds_), room(t_, dt_));
    for (int j = 0; j < n_; ++j) {
      z_[j] += a * dz_[j];
      w_[j] += a * dw_[j];
      s_[j] += b * ds_[j];
      t_[j] += b * dt_[j];
    }
    for (int i = 0; i < m_; ++i) y_[i] += b * dy_[i];
  }
  return best;
}

}  // namespace

LinearSolution solve(const LinearProgram& program) { return Method(program).run(); }

}  // namespace armdyn
