/// Extend-add of the multifrontal factorization: adds the contribution block of a child to the front of its parent.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

template <class T>
using Columns = nb::ndarray<T, nb::ndim<2>, nb::device::cpu>;
using Places = nb::ndarray<const std::int64_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

bool within(const Places& places, std::size_t size) {
  for (std::size_t k = 0; k < places.shape(0); ++k)
    if (places.data()[k] < 0 || static_cast<std::size_t>(places.data()[k]) >= size) return false;
  return true;
}

template <class T>
void add(const Columns<T>& to, const Columns<const T>& from, const Places& rows, const Places& columns, bool lower) {
  if (rows.shape(0) != from.shape(0) || columns.shape(0) != from.shape(1))
    throw nb::value_error("rows and columns must have one index for each row and column of from_");
  if (!within(rows, to.shape(0)) || !within(columns, to.shape(1))) throw nb::value_error("an index lies outside the matrix");
  if (from.shape(0) > 0 && from.shape(1) > 0 && (to.stride(0) != 1 || from.stride(0) != 1))
    throw nb::value_error("the matrices must be in Fortran order");
  const nb::gil_scoped_release unlocked;
  const std::int64_t* const row = rows.data();
  const auto count = static_cast<std::ptrdiff_t>(rows.shape(0));
  for (std::size_t j = 0; j < columns.shape(0); ++j) {
    T* const t = to.data() + columns.data()[j] * to.stride(1);
    const T* const f = from.data() + static_cast<std::int64_t>(j) * from.stride(1);
    for (auto i = lower ? static_cast<std::ptrdiff_t>(j) : 0; i < count; ++i) t[row[i]] += f[i];
  }
}

}  // namespace

void bind_front(nb::module_& m) {
  const char* const doc = "Add from_ to to[rows, columns], both in Fortran order. lower: skip the entries above the diagonal.";
  m.def("scatter_add", add<double>, "to"_a, "from_"_a, "rows"_a, "columns"_a, "lower"_a = false, doc);
  m.def("scatter_add", add<float>, "to"_a, "from_"_a, "rows"_a, "columns"_a, "lower"_a = false, doc);
}
