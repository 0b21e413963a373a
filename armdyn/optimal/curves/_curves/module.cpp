// Python bindings: arrays in, bytes of numbers out. They release the GIL.
#include "quadratic_program.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

namespace nb = nanobind;

namespace {

using Reals = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Wholes = nb::ndarray<const int, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <typename T>
nb::bytes bytes_of(const std::vector<T>& table) {
  return nb::bytes(table.data(), table.size() * sizeof(T));
}

// (start, column, value) of compressed rows on `size` columns.
armdyn::SparseRows sparse(const nb::tuple& given, int size) {
  const auto start = nb::cast<Wholes>(given[0]), column = nb::cast<Wholes>(given[1]);
  const auto value = nb::cast<Reals>(given[2]);
  const int rows = static_cast<int>(start.size()) - 1;
  bool fits = rows >= 0 && start.data()[0] == 0 && column.size() == value.size() &&
              start.data()[rows] == static_cast<int>(column.size());
  for (int i = 0; fits && i < rows; ++i) fits = start.data()[i] <= start.data()[i + 1];
  for (std::size_t e = 0; fits && e < column.size(); ++e) fits = column.data()[e] >= 0 && column.data()[e] < size;
  if (!fits) throw nb::value_error("invalid compressed rows, or a column beyond the unknowns");
  return {rows, start.data(), column.data(), value.data()};
}

void expect(std::size_t got, std::size_t want, const char* what) {
  if (got != want)
    throw nb::value_error((std::string(what) + ": expected " + std::to_string(want) + " numbers, got " +
                           std::to_string(got)).c_str());
}

nb::tuple solve(const Wholes& place, const Reals& gradient, const nb::tuple& curvature, const nb::tuple& squares,
                const Reals& square_weight, const Reals& lower, const Reals& upper, const nb::tuple& rows,
                const Reals& top, const Wholes& slack, const Reals& price, double tolerance, int most) {
  armdyn::QuadraticProgram p;
  p.size = static_cast<int>(gradient.size());
  p.curvature = sparse(curvature, p.size);
  p.squares = sparse(squares, p.size);
  p.rows = sparse(rows, p.size);
  p.slacks = static_cast<int>(price.size());
  expect(place.size(), p.size, "place");
  expect(lower.size(), p.size, "lower");
  expect(upper.size(), p.size, "upper");
  expect(p.curvature.rows, p.size, "curvature");
  expect(square_weight.size(), p.squares.rows, "square_weight");
  expect(top.size(), p.rows.rows, "top");
  expect(slack.size(), p.rows.rows, "slack");
  for (std::size_t i = 0; i < slack.size(); ++i)
    if (slack.data()[i] < -1 || slack.data()[i] >= p.slacks) throw nb::value_error("slack: index without a price");
  std::vector<char> taken(p.size, 0);
  for (int i = 0; i < p.size; ++i) {
    const int at = place.data()[i];
    if (at >= p.size || (at >= 0 && taken[at]++)) throw nb::value_error("place: two unknowns at one place, or beyond");
    if (at >= 0 && !(lower.data()[i] < upper.data()[i])) throw nb::value_error("lower: not below upper");
  }
  for (int i = 0, ended = 0; i < p.size; ++i) {
    if (ended && taken[i]) throw nb::value_error("place: a gap");
    ended = ended || !taken[i];
  }
  p.place = place.data();
  p.gradient = gradient.data();
  p.square_weight = square_weight.data();
  p.lower = lower.data();
  p.upper = upper.data();
  p.top = top.data();
  p.slack = slack.data();
  p.price = price.data();
  p.tolerance = tolerance;
  p.most = most;
  armdyn::QuadraticSolution found;
  {
    nb::gil_scoped_release others_go_on;
    found = armdyn::solve(p);
  }
  return nb::make_tuple(found.found, found.iterations, found.cost, bytes_of(found.step), bytes_of(found.multipliers),
                        bytes_of(found.bounds));
}

}  // namespace

NB_MODULE(_armdyn_curves, m) {
  m.doc() = "Quadratic programs of curves.";
  m.def("solve", &solve, nb::kw_only(), nb::arg("place"), nb::arg("gradient"), nb::arg("curvature"),
        nb::arg("squares"), nb::arg("square_weight"), nb::arg("lower"), nb::arg("upper"), nb::arg("rows"),
        nb::arg("top"), nb::arg("slack"), nb::arg("price"), nb::arg("tolerance"), nb::arg("most"),
        "Solve a quadratic program; see quadratic_program.hpp for the names. Releases the GIL.");
}
