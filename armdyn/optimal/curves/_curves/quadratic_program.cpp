// Predictor-corrector method of S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM
// Journal on Optimization 2(4), 1992, for quadratic programs as in Nocedal and Wright, Numerical Optimization,
// 2006, algorithm 16.4. Slacks are eliminated with their rows, so that the linear equations contain the unknowns only.
#include "quadratic_program.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

using Numbers = std::vector<double>;

constexpr double kInside = 0.05;   // distance of the start from bounds, as a part of their width
constexpr double kBack = 0.995;    // fraction to the boundary of a step
constexpr double kLeast = 1e-30;   // pivot that counts as zero

// Nonnegative quantity and its multiplier, with their directions.
struct Pair {
  Numbers value, multiplier, d_value, d_multiplier, centring;

  void resize(std::size_t n) {
    for (Numbers* each : {&value, &multiplier, &d_value, &d_multiplier, &centring}) each->assign(n, 0.0);
  }
  double product(double step = 0.0) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < value.size(); ++i)
      sum += (value[i] + step * d_value[i]) * (multiplier[i] + step * d_multiplier[i]);
    return sum;
  }
  // Largest step up to 1 that keeps both nonnegative.
  double room() const {
    double step = 1.0;
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (d_value[i] < 0) step = std::min(step, -value[i] / d_value[i]);
      if (d_multiplier[i] < 0) step = std::min(step, -multiplier[i] / d_multiplier[i]);
    }
    return step;
  }
  void move(double step) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      value[i] += step * d_value[i];
      multiplier[i] += step * d_multiplier[i];
    }
  }
  // First-order change of value x multiplier: to `target`, minus the product of the last directions.
  void aim(double target, bool corrected) {
    for (std::size_t i = 0; i < value.size(); ++i)
      centring[i] = target - value[i] * multiplier[i] - (corrected ? d_value[i] * d_multiplier[i] : 0.0);
  }
};

class Method {
 public:
  explicit Method(const QuadraticProgram& program);
  QuadraticSolution run();

 private:
  std::vector<char> kept();
  Profile profile() const;
  void begin();
  double residuals();  // relative residuals of the optimality conditions
  void factorise();
  void direction();
  QuadraticSolution result(bool found, int iterations) const;

  const QuadraticProgram& p_;
  const int n_;
  std::vector<int> unknown_;  // unknown of each place
  Numbers price_;         // prices of the slacks with rows
  std::vector<int> own_;  // slack of each row, in the program's order, then in rows_'s
  BlockRows rows_;
  BlockRows squares_;
  Profile curved_, matrix_;  // Hessian of the cost, and matrix of the linear equations
  Pair low_, high_, row_, slack_;  // distances from bounds, distances of rows from their upper sides, slacks
  Numbers x_, gradient_, top_, scale_, dual_, primal_, slack_dual_, step_, weight_, sum_, moved_, of_rows_;
  double square_ = 0.0;  // x . curvature x
};

std::vector<int> unknowns(const QuadraticProgram& p) {
  const int n = static_cast<int>(std::count_if(p.place, p.place + p.size, [](int at) { return at >= 0; }));
  std::vector<int> out(n);
  for (int i = 0; i < p.size; ++i)
    if (p.place[i] >= 0) out[p.place[i]] = i;
  return out;
}

Method::Method(const QuadraticProgram& program)
    : p_(program),
      n_(static_cast<int>(unknowns(program).size())),
      unknown_(unknowns(program)),
      rows_(program.rows, own_, kept(), program.place),
      squares_(program.squares, std::vector<int>(program.squares.rows, -1),
               std::vector<char>(program.squares.rows, 1), program.place),
      curved_(profile()),
      matrix_(curved_) {
  for (Numbers* each : {&x_, &gradient_, &dual_, &step_, &moved_}) each->assign(n_, 0.0);
  for (Numbers* each : {&top_, &primal_, &weight_, &of_rows_}) each->assign(rows_.size(), 0.0);
  for (int i = 0; i < n_; ++i) gradient_[i] = p_.gradient[unknown_[i]];
  std::vector<int> own(rows_.size());
  for (int i = 0; i < rows_.size(); ++i) {
    top_[i] = p_.top[rows_.order[i]];
    own[i] = own_[rows_.order[i]];
  }
  own_ = own;
  Numbers weights(squares_.size());
  for (int i = 0; i < squares_.size(); ++i) weights[i] = p_.square_weight[squares_.order[i]];
  squares_.add_to(curved_, weights.data(), nullptr);
  for (int i = 0; i < p_.curvature.rows; ++i)
    for (int e = p_.curvature.start[i]; e < p_.curvature.start[i + 1]; ++e) {
      const int row = p_.place[i], column = p_.place[p_.curvature.column[e]];
      if (column >= 0 && column <= row) curved_.row(row)[column] += p_.curvature.value[e];
    }
  for (Numbers* each : {&slack_dual_, &sum_}) each->assign(price_.size(), 0.0);
  scale_.assign(n_, 1.0);
  rows_.largest(scale_.data());
  low_.resize(n_);
  high_.resize(n_);
  row_.resize(rows_.size());
  slack_.resize(price_.size());
}

// Rows that a step within the bounds can violate; the others' slacks are zero.
std::vector<char> Method::kept() {
  std::vector<char> out(p_.rows.rows);
  std::vector<int> slack(p_.slacks, -1);
  own_.assign(p_.rows.rows, -1);
  for (int i = 0; i < p_.rows.rows; ++i) {
    double most = 0.0;
    for (int e = p_.rows.start[i]; e < p_.rows.start[i + 1]; ++e) {
      const int k = p_.rows.column[e];
      if (p_.place[k] >= 0) most += std::max(p_.rows.value[e] * p_.lower[k], p_.rows.value[e] * p_.upper[k]);
    }
    out[i] = most > p_.top[i];
    if (!out[i] || p_.slack[i] < 0) continue;
    if (slack[p_.slack[i]] < 0) {
      slack[p_.slack[i]] = static_cast<int>(price_.size());
      price_.push_back(p_.price[p_.slack[i]]);
    }
    own_[i] = slack[p_.slack[i]];
  }
  return out;
}

Profile Method::profile() const {
  std::vector<int> first(n_);
  for (int i = 0; i < n_; ++i) first[i] = i;
  for (int i = 0; i < p_.curvature.rows; ++i)
    for (int e = p_.curvature.start[i]; e < p_.curvature.start[i + 1]; ++e) {
      const int row = p_.place[i], column = p_.place[p_.curvature.column[e]];
      if (row >= 0 && column >= 0) first[row] = std::min(first[row], column);
    }
  rows_.widen(first);
  squares_.widen(first);
  return Profile(first);
}

void Method::begin() {
  double widest = 0.0;
  for (int i = 0; i < n_; ++i) {
    const double a = p_.lower[unknown_[i]], b = p_.upper[unknown_[i]], inside = kInside * (b - a);
    x_[i] = std::clamp(0.0, a + inside, b - inside);
    low_.value[i] = x_[i] - a;
    high_.value[i] = b - x_[i];
    widest = std::max(widest, std::abs(gradient_[i]) * (b - a));
  }
  rows_.times(x_.data(), of_rows_.data());
  std::vector<int> count(price_.size(), 0);
  Numbers missing(price_.size(), 0.0);
  for (int i = 0; i < rows_.size(); ++i)
    if (own_[i] >= 0) {
      ++count[own_[i]];
      missing[own_[i]] = std::max(missing[own_[i]], of_rows_[i] - top_[i]);
    }
  double barrier = 1e-2 * std::max(widest, 1e-12);
  for (std::size_t g = 0; g < price_.size(); ++g) {
    slack_.multiplier[g] = price_[g] / 2;
    slack_.value[g] = missing[g] + barrier / slack_.multiplier[g];
  }
  for (int i = 0; i < rows_.size(); ++i) {
    const double spare = top_[i] - of_rows_[i] + (own_[i] < 0 ? 0.0 : slack_.value[own_[i]]);
    if (own_[i] < 0) {
      row_.value[i] = std::max(spare, 1e-2);
      row_.multiplier[i] = barrier / row_.value[i];
    } else {
      row_.value[i] = std::max(spare, 1e-12);
      row_.multiplier[i] = std::min(barrier / row_.value[i], price_[own_[i]] / (2 * count[own_[i]]));
    }
  }
  for (int i = 0; i < n_; ++i) {
    low_.multiplier[i] = barrier / low_.value[i];
    high_.multiplier[i] = barrier / high_.value[i];
  }
}

double Method::residuals() {
  curved_.times(x_.data(), moved_.data());
  square_ = 0.0;
  double largest = 0.0, off = 0.0;
  for (int i = 0; i < n_; ++i) {
    square_ += x_[i] * moved_[i];
    dual_[i] = gradient_[i] + moved_[i] - low_.multiplier[i] + high_.multiplier[i];
    largest = std::max(largest, std::abs(gradient_[i]));
  }
  rows_.transposed(row_.multiplier.data(), dual_.data());
  rows_.times(x_.data(), of_rows_.data());
  slack_dual_ = price_;
  for (int i = 0; i < rows_.size(); ++i) {
    const int g = own_[i];
    primal_[i] = of_rows_[i] - (g < 0 ? 0.0 : slack_.value[g]) + row_.value[i] - top_[i];
    if (g >= 0) slack_dual_[g] -= row_.multiplier[i];
    off = std::max(off, std::abs(primal_[i]) / (1 + std::abs(top_[i])));
  }
  for (std::size_t g = 0; g < price_.size(); ++g) {
    slack_dual_[g] -= slack_.multiplier[g];
    off = std::max(off, std::abs(slack_dual_[g]) / (1 + price_[g]));
  }
  for (int i = 0; i < n_; ++i) off = std::max(off, std::abs(dual_[i]) / (scale_[i] * (1 + largest)));
  return off;
}

void Method::factorise() {
  matrix_ = curved_;
  for (int i = 0; i < n_; ++i)
    matrix_.row(i)[i] += low_.multiplier[i] / low_.value[i] + high_.multiplier[i] / high_.value[i];
  for (std::size_t g = 0; g < price_.size(); ++g) sum_[g] = slack_.multiplier[g] / slack_.value[g];
  for (int i = 0; i < rows_.size(); ++i) weight_[i] = row_.multiplier[i] / row_.value[i];
  rows_.add_to(matrix_, weight_.data(), sum_.data());
  for (int i = 0; i < rows_.size(); ++i)
    if (own_[i] >= 0) sum_[own_[i]] += weight_[i];
  matrix_.factorise(kLeast);
}

// Newton direction to the centred four pairs.
void Method::direction() {
  // Multiplier of a row: weight (a . step - slack's step) + of_rows_; slack's step: (weight (a . step) + moved) / sum.
  Numbers& slack_moved = slack_.d_value;
  for (std::size_t g = 0; g < price_.size(); ++g) slack_moved[g] = slack_.centring[g] / slack_.value[g] - slack_dual_[g];
  for (int i = 0; i < rows_.size(); ++i) {
    of_rows_[i] = weight_[i] * primal_[i] + row_.centring[i] / row_.value[i];
    if (own_[i] >= 0) slack_moved[own_[i]] += of_rows_[i];
  }
  Numbers& pushed = row_.d_value;
  for (int i = 0; i < rows_.size(); ++i)
    pushed[i] = -of_rows_[i] + (own_[i] < 0 ? 0.0 : weight_[i] * (slack_moved[own_[i]] / sum_[own_[i]]));
  for (int i = 0; i < n_; ++i)
    step_[i] = -dual_[i] + low_.centring[i] / low_.value[i] - high_.centring[i] / high_.value[i];
  rows_.transposed(pushed.data(), step_.data());
  matrix_.solve(step_.data());

  Numbers& along = row_.d_value;
  rows_.times(step_.data(), along.data());
  for (int i = 0; i < rows_.size(); ++i)
    if (own_[i] >= 0) slack_moved[own_[i]] += weight_[i] * along[i];
  for (std::size_t g = 0; g < price_.size(); ++g) {
    slack_moved[g] /= sum_[g];
    slack_.d_multiplier[g] = (slack_.centring[g] - slack_.multiplier[g] * slack_moved[g]) / slack_.value[g];
  }
  for (int i = 0; i < rows_.size(); ++i) {
    const double change = along[i] - (own_[i] < 0 ? 0.0 : slack_moved[own_[i]]);
    row_.d_multiplier[i] = weight_[i] * change + of_rows_[i];
    row_.d_value[i] = -primal_[i] - change;
  }
  for (int i = 0; i < n_; ++i) {
    low_.d_value[i] = step_[i];
    high_.d_value[i] = -step_[i];
    low_.d_multiplier[i] = (low_.centring[i] - low_.multiplier[i] * step_[i]) / low_.value[i];
    high_.d_multiplier[i] = (high_.centring[i] + high_.multiplier[i] * step_[i]) / high_.value[i];
  }
}

QuadraticSolution Method::run() {
  begin();
  Pair* pairs[] = {&low_, &high_, &row_, &slack_};
  const double count = 2.0 * n_ + rows_.size() + price_.size();
  for (int k = 0; k < p_.most; ++k) {
    const double off = residuals();
    double gap = 0.0;
    for (const Pair* each : pairs) gap += each->product();
    if (!std::isfinite(gap + off)) return result(false, k);
    double size = std::abs(square_);
    for (int i = 0; i < n_; ++i) size = std::max(size, std::abs(gradient_[i] * x_[i]));
    if (off < p_.tolerance && gap < p_.tolerance * (1 + size)) return result(true, k);
    factorise();
    for (Pair* each : pairs) each->aim(0.0, false);
    direction();
    double room = 1.0, after = 0.0;
    for (const Pair* each : pairs) room = std::min(room, each->room());
    for (const Pair* each : pairs) after += each->product(room);
    const double target = gap / count * std::pow(std::max(after, 0.0) / gap, 3);
    for (Pair* each : pairs) each->aim(target, true);
    direction();
    room = 1.0;
    for (const Pair* each : pairs) room = std::min(room, each->room());
    const double step = std::min(1.0, kBack * room);
    for (Pair* each : pairs) each->move(step);
    for (int i = 0; i < n_; ++i) x_[i] += step * step_[i];
  }
  return result(residuals() < 1e-6, p_.most);
}

QuadraticSolution Method::result(bool found, int iterations) const {
  QuadraticSolution out;
  out.found = found;
  out.iterations = iterations;
  out.step.assign(p_.size, 0.0);
  out.bounds.assign(p_.size, 0.0);
  out.multipliers.assign(p_.rows.rows, 0.0);
  out.cost = square_ / 2;
  for (int i = 0; i < n_; ++i) {
    out.step[unknown_[i]] = x_[i];
    out.bounds[unknown_[i]] = high_.multiplier[i] - low_.multiplier[i];
    out.cost += gradient_[i] * x_[i];
  }
  for (std::size_t g = 0; g < price_.size(); ++g) out.cost += price_[g] * slack_.value[g];
  for (int i = 0; i < rows_.size(); ++i) out.multipliers[rows_.order[i]] = row_.multiplier[i];
  return out;
}

}  // namespace

QuadraticSolution solve(const QuadraticProgram& program) { return Method(program).run(); }

}  // namespace armdyn
