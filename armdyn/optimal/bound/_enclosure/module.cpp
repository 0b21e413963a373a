// Python bindings: arrays in and out. They release the GIL.
#include "form.hpp"
#include "linear_program.hpp"
#include "program.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <initializer_list>
#include <optional>
#include <vector>

namespace nb = nanobind;

namespace {

using Reals = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Wholes = nb::ndarray<const int, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using armdyn::Operation;
using armdyn::Program;

void expect(bool fits) {
  if (!fits) throw nb::value_error("the arrays do not match each other");
}

// A new array that owns its memory.
class Fresh {
 public:
  explicit Fresh(std::initializer_list<std::size_t> shape) : shape_(shape) {
    std::size_t size = 1;
    for (const std::size_t each : shape_) size *= each;
    values_ = new double[size]();
  }
  Fresh(const Fresh&) = delete;
  Fresh& operator=(const Fresh&) = delete;
  ~Fresh() { delete[] values_; }

  double* data() { return values_; }
  nb::object release() {
    nb::capsule owner(values_, [](void* p) noexcept { delete[] static_cast<double*>(p); });
    double* values = values_;
    values_ = nullptr;
    return nb::cast(nb::ndarray<nb::numpy, double>(values, shape_.size(), shape_.data(), owner));
  }

 private:
  std::vector<std::size_t> shape_;
  double* values_;
};

// steps: (instructions, 4): operation, into, first, second, see program.hpp; values: constants.
Program program_of(const Wholes& steps, const Reals& values, int places, int inputs, int outputs) {
  Program program{{}, places, inputs, outputs};
  expect(steps.shape(1) == 4 && values.size() == steps.shape(0) && places > 0 && inputs >= 0 && outputs >= 0);
  const auto below = [](int index, int count) { expect(index >= 0 && index < count); };
  for (std::size_t k = 0; k < steps.shape(0); ++k) {
    const int* step = steps.data() + 4 * k;
    below(step[0], static_cast<int>(Operation::multiply) + 1);
    const auto operation = static_cast<Operation>(step[0]);
    below(step[1], operation == Operation::output ? outputs : places);
    below(step[2], operation == Operation::input ? inputs : places);
    below(step[3], places);
    program.instructions.push_back({operation, step[1], step[2], step[3], values.data()[k]});
  }
  return program;
}

nb::tuple in_intervals(const Program& program, const Reals& lower, const Reals& upper) {
  expect(lower.ndim() == 2 && upper.ndim() == 2 && lower.shape(0) == static_cast<std::size_t>(program.inputs) &&
         upper.shape(0) == lower.shape(0) && upper.shape(1) == lower.shape(1));
  const std::size_t boxes = lower.shape(1), outputs = program.outputs;
  Fresh first({outputs, boxes}), last({outputs, boxes});
  {
    nb::gil_scoped_release others_go_on;
    armdyn::in_intervals(program, static_cast<int>(boxes), lower.data(), upper.data(), first.data(), last.data());
  }
  return nb::make_tuple(first.release(), last.release());
}

nb::tuple in_affine_forms(const Program& program, const Reals& centre, const Reals& radius) {
  expect(centre.ndim() == 2 && radius.ndim() == 2 && centre.shape(0) == static_cast<std::size_t>(program.inputs) &&
         radius.shape(0) == centre.shape(0) && radius.shape(1) == centre.shape(1));
  const std::size_t boxes = centre.shape(1), inputs = program.inputs, outputs = program.outputs;
  Fresh middle({outputs, boxes}), slopes({outputs, inputs, boxes}), rest({outputs, boxes});
  {
    nb::gil_scoped_release others_go_on;
    armdyn::in_affine_forms(program, static_cast<int>(boxes), centre.data(), radius.data(), middle.data(),
                            slopes.data(), rest.data());
  }
  return nb::make_tuple(middle.release(), slopes.release(), rest.release());
}

// Arrays of a form, kept alive during its evaluation.
using Kept = std::vector<Reals>;

armdyn::Table table(const nb::tuple& given, std::size_t size, Kept& kept) {
  expect(given.size() == 2);
  for (const std::size_t end : {0, 1}) {
    kept.push_back(nb::cast<Reals>(given[end]));
    expect(kept.back().size() == size);
  }
  return {kept[kept.size() - 2].data(), kept.back().data()};
}

nb::tuple range_of(const Reals& v_lower, const Reals& v_upper, int many, const nb::tuple& linear,
                   const nb::tuple& squares, const std::optional<nb::tuple>& turning, const nb::tuple& weight,
                   bool corners) {
  expect(v_lower.ndim() == 2 && v_upper.size() == v_lower.size() && many > 0 && v_lower.shape(1) > 0);
  const std::size_t boxes = v_lower.shape(0), n = v_lower.shape(1), size = boxes * n * many;
  expect(!corners || n < 20);
  Kept kept;
  armdyn::Form form{static_cast<int>(boxes), static_cast<int>(n), many, {v_lower.data(), v_upper.data()},
                    table(linear, size, kept), table(squares, size * (n + 1) / 2, kept),
                    turning ? table(*turning, size * n, kept) : armdyn::Table{}, table(weight, size, kept), corners};
  Fresh lower({boxes, static_cast<std::size_t>(many)}), upper({boxes, static_cast<std::size_t>(many)});
  {
    nb::gil_scoped_release others_go_on;
    armdyn::range_of(form, lower.data(), upper.data());
  }
  return nb::make_tuple(lower.release(), upper.release());
}

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Places = nb::ndarray<const int, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

nb::tuple solve(const Places& start, const Places& row, const Numbers& value, const Numbers& right, const Numbers& cost,
                const Numbers& lower, const Numbers& upper, double tolerance, int most) {
  const std::size_t columns = cost.size();
  expect(start.size() == columns + 1 && lower.size() == columns && upper.size() == columns &&
         row.size() == value.size() && start.data()[0] == 0 && start.data()[columns] == static_cast<int>(row.size()));
  for (std::size_t j = 0; j < columns; ++j) {
    expect(start.data()[j] <= start.data()[j + 1] && lower.data()[j] <= upper.data()[j]);
    for (int e = start.data()[j]; e < start.data()[j + 1]; ++e)
      expect(row.data()[e] < static_cast<int>(right.size()) && row.data()[e] >= 0 &&
             (e == start.data()[j] || row.data()[e - 1] < row.data()[e]));
  }
  armdyn::LinearProgram program{static_cast<int>(right.size()), static_cast<int>(columns), start.data(), row.data(),
                                value.data(), right.data(), cost.data(), lower.data(), upper.data(), tolerance, most};
  armdyn::LinearSolution found;
  {
    nb::gil_scoped_release others_go_on;
    found = armdyn::solve(program);
  }
  Fresh multipliers({right.size()});
  std::copy(found.multipliers.begin(), found.multipliers.end(), multipliers.data());
  return nb::make_tuple(found.found, found.iterations, found.cost, multipliers.release());
}

}  // namespace

NB_MODULE(_armdyn_enclosure, m) {
  m.doc() = "Enclosures of functions and forms over boxes, for lower bounds.";
  nb::class_<Program>(m, "Program", "A function of one vector as instructions; see program.hpp.")
      .def("__init__",
           [](Program* self, const Wholes& steps, const Reals& values, int places, int inputs, int outputs) {
             new (self) Program(program_of(steps, values, places, inputs, outputs));
           },
           nb::arg("steps"), nb::arg("values"), nb::arg("places"), nb::arg("inputs"), nb::arg("outputs"))
      .def("in_intervals", &in_intervals, nb::arg("lower"), nb::arg("upper"))
      .def("in_affine_forms", &in_affine_forms, nb::arg("centre"), nb::arg("radius"));
  m.def("range_of", &range_of, nb::arg("v_lower"), nb::arg("v_upper"), nb::arg("many"), nb::arg("linear"),
        nb::arg("squares"), nb::arg("turning").none(), nb::arg("weight"), nb::arg("corners"),
        "Range of a form that is quadratic in v over boxes of v; see form.hpp.");
  m.def("solve", &solve, nb::kw_only(), nb::arg("start"), nb::arg("row"), nb::arg("value"), nb::arg("right"),
        nb::arg("cost"), nb::arg("lower"), nb::arg("upper"), nb::arg("tolerance"), nb::arg("most"),
        "Solve a linear program in boxes; see linear_program.hpp. Releases the GIL.");
}
