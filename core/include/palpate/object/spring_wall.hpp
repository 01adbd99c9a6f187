#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"
#include "palpate/object/virtual_coupling.hpp"

namespace palpate::object {

/// Shape of a SpringWall.
enum class SpringWallKind {
  none,        ///< no object
  point,       ///< bilateral spring to a point (Hosseini-Zadeh 2004, chapters 3 to 5)
  half_space,  ///< unilateral wall, along its normal
};

/// Parameters of a spring or wall with linear stiffness and damping.
struct SpringWallParameters {
  SpringWallKind kind = SpringWallKind::none;
  Vector3<> point = Vector3<>::Zero();      ///< on the surface, m
  Vector3<> normal = Vector3<>::UnitZ();    ///< unit, out of the wall
  Vector3<> stiffness = Vector3<>::Zero();  ///< per axis, N/m
  Vector3<> damping = Vector3<>::Zero();    ///< per axis, N*s/m
  CouplingDifference difference = CouplingDifference::backward;
};

/// Spring to a point or unilateral wall, the objects of the sampled-data literature. Runs in SIMD lanes.
template <class Number>
class BasicSpringWall {
 public:
  using Scalar = Number;
  using Kind = SpringWallKind;
  using Result = BasicContactResult<Scalar>;

  BasicSpringWall() = default;
  explicit BasicSpringWall(const SpringWallParameters& p)
      : kind_(p.kind), point_(p.point), normal_(p.normal), coupling_(p.stiffness, p.damping, p.difference) {
    result_.stiffness = p.normal.dot(p.stiffness.cwiseProduct(p.normal));
    if (kind_ == Kind::point) result_.axis_stiffness = p.stiffness;
  }

  /// Return contact and force for one sample of the tip.
  [[gnu::always_inline]] const Result& step(const BasicTipState<Scalar>& tip) noexcept {
    Vector3<Scalar>& force = result_.force;
    if (kind_ == Kind::none) {
      force = coupling_.force(result_.deflection, tip.rate);
      return result_;
    }
    const Vector3<Scalar> offset = tip.position - point_;
    if (kind_ == Kind::point) {
      result_.touching = true;
      result_.deflection = offset;
      force = coupling_.force(offset, tip.rate);
      return result_;
    }
    const Scalar none = 0.0;
    const Scalar height = normal_.dot(offset);
    const auto apart = height >= none;
    result_.touching = !apart;
    result_.depth = -height;
    result_.normal = normal_;
    result_.deflection = select(apart, none, height) * normal_;
    // A wall pushes and never pulls: neither its damper on the way out nor its memory after contact.
    const Scalar along = normal_.dot(coupling_.force(result_.deflection, tip.rate));
    force = select(result_.touching & (along < none), along, none) * normal_;
    return result_;
  }

  [[nodiscard]] const Result& result() const noexcept { return result_; }

  void reset() noexcept {
    coupling_.reset();
    const Result last = result_;
    result_ = {};
    result_.stiffness = last.stiffness;
    result_.axis_stiffness = last.axis_stiffness;
  }

  /// Set one lane from a scalar object of the same kind.
  void set_lane(int lane, const BasicSpringWall<double>& one) {
    using math::set_lane;
    kind_ = one.kind_;
    set_lane(point_, lane, one.point_);
    set_lane(normal_, lane, one.normal_);
    coupling_.set_lane(lane, one.coupling_);
    set_lane(result_.stiffness, lane, one.result_.stiffness);
    set_lane(result_.axis_stiffness, lane, one.result_.axis_stiffness);
  }

 private:
  template <class>
  friend class BasicSpringWall;

  Kind kind_ = Kind::none;
  Vector3<Scalar> point_ = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> normal_ = Vector3<Scalar>(Scalar(0.0), Scalar(0.0), Scalar(1.0));
  BasicVirtualCoupling<Scalar> coupling_;
  Result result_;
};
using SpringWall = BasicSpringWall<double>;

}  // namespace palpate::object
