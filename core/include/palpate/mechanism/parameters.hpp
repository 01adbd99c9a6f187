#pragma once

#include <Eigen/Core>
#include <type_traits>

namespace palpate::mechanism {

/// Kind of a joint: its coordinate is an angle [rad] or a displacement [m].
enum class JointKind { revolute, prismatic };

/// Values that a parameter allows.
enum class ParameterRange { any, nonnegative, positive };

/// One parameter of a mechanism as device files name it.
template <class Parameters>
struct ParameterField {
  const char* key;   ///< "section.name", as in the device file
  const char* unit;  ///< SI unit, "" for a plain number
  ParameterRange range;
  bool required;
  const char* description;
  int size;  ///< 1, or one value per joint or axis
  void (*assign)(Parameters&, const double*);
  void (*read)(const Parameters&, double*);
};

namespace detail {

template <class Member>
struct MemberTraits;
template <class Parameters_, class Value_>
struct MemberTraits<Value_ Parameters_::*> {
  using Parameters = Parameters_;
  using Value = Value_;
};

}  // namespace detail

/// Describes the member `member` of a parameter structure, a double or a vector of fixed size.
template <auto member>
[[nodiscard]] constexpr auto parameter(const char* key, const char* unit, ParameterRange range, const char* description,
                                       bool required = true) {
  using Parameters = typename detail::MemberTraits<decltype(member)>::Parameters;
  using Value = typename detail::MemberTraits<decltype(member)>::Value;
  if constexpr (std::is_same_v<Value, double>) {
    return ParameterField<Parameters>{key,
                                      unit,
                                      range,
                                      required,
                                      description,
                                      1,  //
                                      [](Parameters& p, const double* values) { p.*member = *values; },
                                      [](const Parameters& p, double* values) { *values = p.*member; }};
  } else {
    return ParameterField<Parameters>{key,
                                      unit,
                                      range,
                                      required,
                                      description,
                                      Value::SizeAtCompileTime,  //
                                      [](Parameters& p, const double* values) { p.*member = Eigen::Map<const Value>(values); },
                                      [](const Parameters& p, double* values) { Eigen::Map<Value>{values} = p.*member; }};
  }
}

}  // namespace palpate::mechanism
