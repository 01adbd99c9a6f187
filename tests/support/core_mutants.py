"""Mistakes chosen for the headers of the core; `core_mutate.py` compiles all of them behind one switch.

Some survive because they change no result:
- `proxy.hpp`, no stiffness: `FrictionCone::remaining_lag` also counts infinity times zero as no friction.
- `contact_lcp.hpp`, pivot above zero: only the shares of coincident rows change.
- `sphere_proxy.hpp`, tip that is not away: the center differs from the tip by rounding.

One run over all 146 (23 November 2026): GoogleTests alone kill 25 of 25 in plant, 35 of 35 in servo, 28 of 30 in mesh and
55 of 56 in deformable, 97.9 % together. The three above survive the Python tests too; they count as survivors.
"""

# ruff: noqa: E501
from __future__ import annotations

from typing import Final, NamedTuple

ON: Final = "$ON"  # in `new`: true where the mutant is switched on


class CoreMutant(NamedTuple):
    """One mistake: text that a header contains once, and the text in its place.

    An expression or statement is replaced when the mutant is on; an empty ``new`` drops a statement. A ``new`` with
    `ON` replaces ``old`` in all builds.
    """

    header: str
    old: str
    new: str

    def switched(self, number: int) -> str:
        """Return the text that contains both."""
        on = f"palpate_mutant({number})"
        if ON in self.new:
            return self.new.replace(ON, on)
        if self.old.endswith(";"):
            return f"if ({on}) {{ {self.new} }} else {{ {self.old} }}"
        return f"({on} ? ({self.new}) : ({self.old}))"


def _table(text: str) -> tuple[CoreMutant, ...]:
    """Return the mutants of blocks "== header", each line "old => new"; a backslash and n stand for a line break."""
    found: list[CoreMutant] = []
    header = ""
    for line in text.splitlines():
        if line.startswith("== "):
            header = line[3:]
        elif line:
            old, _, new = line.partition(" =>")
            found.append(CoreMutant(header, old.replace("\\n", "\n"), new.strip()))
    return tuple(found)


CORE_MUTANTS: Final = _table(r"""
== plant/plant_dynamics.hpp
force + t * force_rate => force + ($ON ? Scalar(0.0) : t) * force_rate
friction_.viscous[i] * s.qd[i] => -(friction_.viscous[i] * s.qd[i])
human_arm_.damping * v => ($ON ? Scalar(0.0) : human_arm_.damping) * v
human_arm_.tissue_damping * (s.hand_velocity - v) => ($ON ? Scalar(0.0) : human_arm_.tissue_damping) * (s.hand_velocity - v)
(p - human_arm_.rest) => ($ON ? Vector(p) : Vector(p - human_arm_.rest))
(s.hand_position - human_arm_.rest) => ($ON ? Vector(s.hand_position) : Vector(s.hand_position - human_arm_.rest))
0.5 * half * half => half * half
update_velocities(k2, half); =>
update_velocities(k3, h); =>
y += h * (v + sixth * (a1 + (a2 + a3))); => y += h * (v + sixth * (a1 + (a2 + a4)));
is_small = is_small & mechanism_.is_small(displacement); =>
== plant/plant_integrator.hpp
is_nonzero(force.end) => false
load.force_rate = force.rate(period); => load.force_rate = Vector::Constant(0.0);
static_cast<double>(i) / substeps => static_cast<double>(i + 1) / substeps
any(force[2] != zero) => false
== plant/human_arm.hpp
fraction * (end[i] - begin[i]) => ($ON ? 0.5 : fraction) * (end[i] - begin[i])
(end[i] - begin[i]) / period => (end[i] - begin[i]) * period
== plant/joint_friction.hpp
Scalar(-ratio * ratio) => Scalar(-ratio)
any(breakaway[i] > Scalar(0.0)) => any(coulomb[i] > Scalar(0.0))
== plant/stick_slip.hpp
excess[i] * excess[i] / inertia[i] => excess[i]
select(required[i] > zero, Scalar(-1.0), Scalar(1.0)) => select(required[i] > zero, Scalar(1.0), Scalar(-1.0))
for (int i = 0; i < dof; ++i) next.qd[i] = select(modes.direction[i] * next.qd[i] < Scalar(0.0), Scalar(0.0), next.qd[i]); =>
t = select(mode_ends, t + elapsed, t); =>
violation[i] <= 2.0 * max_of(target[i], zero) => violation[i] <= 2e5 * max_of(target[i], zero)
== plant/sampled_plant.hpp
(torque - operating_torque_) => (torque - ($ON ? Joints<dof>(Joints<dof>::Zero()) : operating_torque_))
== servo/servo.hpp
static_cast<double>(count_++) * period_ => static_cast<double>(++count_) * period_
tick_.command = select_each(tick_.saturated, Vector(applied - gravity_compensation_), wanted); => tick_.command = applied;
control::applied(controller_, tick_.command); => control::applied(controller_, wanted);
if (fault_guard_.elapsed() != period_) return 1.0 / fault_guard_.elapsed(); =>
++count_;\n    tick_.fault = true; => tick_.fault = true;
object::start(object_, tick_.tip);\n    control::reset(controller_); => control::reset(controller_);
--count_; =>
tick_.object_force.setZero(); =>
tick_.command = share * (fault_guard_.command + gravity_compensation_) - gravity_compensation_; => tick_.command = share * fault_guard_.command;
drive_.reset(); =>
const Vector asked = wanted - share; => const Vector asked = $ON ? Vector(wanted) : Vector(wanted - share);
return drive_.torque_scale(torque) * torque; => return $ON ? Angles(torque) : Angles(drive_.torque_scale(torque) * torque);
motors[i] != asked[i] => motors[i] > asked[i]
delay < 0 || delay > 64 => delay < 0
fault_guard_.reset(); =>
== servo/fault_guard.hpp
elapsed > 0.01 * period_ && elapsed < 1e9 => elapsed < 1e9
limits_.speed * since_valid_ => limits_.speed * period_
elapsed_ = since_valid_;\n    since_valid_ = 0.0; => elapsed_ = since_valid_;
std::max(fall_, 1.0 / 8.0) => fall_
std::max(0.0, share_ - fall_) => share_ - fall_
std::abs(values[i]) <= limit => values[i] <= limit
== servo/stability_monitor.hpp
k <= Scalar(from_ + 2.0 * fifth) => k <= Scalar(from_ + 3.0 * fifth)
tip - 2.0 * last_ + before_ => tip - ($ON ? 1.0 : 2.0) * last_ + before_
std::max(unstable, 1.0) => ticks_ + 1.0
was_touching_ < touching => touching < was_touching_
k <= Scalar(ticks_ - fifth) => k <= Scalar(ticks_)
share_before_ = share; =>
== servo/simulation.hpp
const Vector3<> next = force_at(table, std::min(tick + 1, ticks)); => const Vector3<> next = force_at(table, std::min($ON ? tick : tick + 1, ticks));
(late / period) * (next - here) => ($ON ? 0.0 : late / period) * (next - here)
speeds_ = (angles - angles_) * per_period_; => speeds_ = (angles_ - angles) * per_period_;
transpose() * force.begin => transpose() * ($ON ? force.end : force.begin)
clock.remaining(), substeps_ => $ON ? Scalar(clock.elapsed()) : clock.remaining(), substeps_
abs(plant.speeds()[i]) < Scalar(fastest) => plant.speeds()[i] < Scalar(fastest)
if (tick.fault) return monitor.mark_diverged(k); =>
state_.hand_position = s.mechanism.forward(s.start); =>
== mesh/proxy.hpp
damping * (depth - last_depth_) / s.period => damping * depth / s.period
contact_.position = at;\n      last_depth_ = 0.0; => contact_.position = at;
contact_.force -= 0.5 * depth * depth * slope; =>
s.viscous > 0.0) { => s.viscous > 0.0 && !$ON) {
s.dynamic_friction * ratio => s.static_friction * ratio
if (normal == 0.0) cone.mu_static = cone.mu_dynamic = 0.0; =>
slip.distance > slip.threshold => slip.distance > 0.0
depth - radius_, local.slope => $ON ? depth : depth - radius_, local.slope
const Vector3<> on = radius_ > 0.0 ? => const Vector3<> on = radius_ > 0.0 && !$ON ?
push = std::fmax(0.0, push + => push = std::fmax($ON ? -1e300 : 0.0, push +
attachment.offset = frame(f).transpose() * (position() - foot); =>
axis.dot(x) / (1.0 + from.dot(to)) => axis.dot(x) / (2.0 + from.dot(to))
sum.shaded += penetration * shaded; => sum.shaded += shaded;
== mesh/friction_cone.hpp
drag * (distance + lag) => drag * lag
sliding ? mu_dynamic : mu_static => mu_static
was_sliding || distance > threshold => was_sliding
== mesh/force_shading.hpp
sum += TriangleMesh::angle_weighted_normal(mesh.face(next / 3), static_cast<std::size_t>(next % 3)); => sum += mesh.face(next / 3).normal;
sum += TriangleMesh::angle_weighted_normal(mesh.face(h / 3), static_cast<std::size_t>(h % 3)); =>
determinant > 0.05 => determinant > -1e300
== mesh/point_proxy.hpp
state.side = hit_side; => state.side = 1.0;
pseudonormal(face, near.at.feature).dot(tip - near.at.point) => face.normal.dot(tip - near.at.point)
slip.distance += std::fabs(motion > 0.0 ? length - from : from); =>
std::fabs(other) < std::fabs(height) => std::fabs(other) > std::fabs(height)
to >= 0.0 && to <= length => true
open || state.side => (open && !$ON) || state.side
state.side * other >= 0.0 => other >= 0.0
(face.normal + mesh_->face(twin / 3).normal).dot(down) => face.normal.dot(down)
== mesh/surface_field.hpp
qw * 3.0 * g => qw * ($ON ? 2.0 : 3.0) * g
== mesh/sphere_proxy.hpp
p - c * q < -rounding || q - c * p < -rounding => p - c * q < -rounding
if (!away) state.center = tip; =>
== deformable/contact/contact_lcp.hpp
stale_ = stale_ || row_of_[static_cast<std::size_t>(a)] >= 0; =>
pivot > 1e-7 * compliance_(a, a) => pivot > 0.0
violation_[a] > 1e-9 * max_depth => violation_[a] > 1e-3 * max_depth
== deformable/contact/tip_contact.hpp
0.5 * force * force * self => force * force * self
coverage_energy(a, f) / (contact.coverage * contact.coverage) => coverage_energy(a, f) / contact.coverage
f * rest_depth_[static_cast<std::size_t>(a)] => f * contact.depth
lcp_.force(a) > 0.0 ? creep.decay * q + creep.gain * lcp_.force(a) : 0.0 => creep.decay * q + creep.gain * lcp_.force(a)
force * creep_displacement(a) - self / creep.period_ratio * creep.delayed_energy(q * q) => force * creep_displacement(a)
uplift < s.depth - 1e-9 * max_depth_ => uplift < s.depth - 0.5 * max_depth_
cosine >= std::sqrt(0.5) => cosine >= 0.99
contact.depth -= (1.0 / contact.coverage - 1.0) * creep_displacement(a); =>
creep.decay * creep_state_[a] + creep.gain * f => creep.decay * creep_state_[a]
has_last_center_ = last_center_.allFinite(); => has_last_center_ = true;
== deformable/multirate/local_model_slip.hpp
one == other ? mean_self_compliance_ : 0.0 => 0.0
slip_.update_compliance(*this); =>
if (one.squaredNorm() < 0.01) one = outward.unitOrthogonal(); =>
== deformable/contact/partial_slip.hpp
if (at_limit && along > 0.0) lag(s).setZero(); =>
std::sqrt(std::max(before, 0.0) / after) => 1.0
creep_state_[at(s)] = creep_state_[at(last)]; =>
coverage_[at(s)] = coverage_[at(last)]; =>
sliding_ = any && (all || sliding_); => sliding_ = any && all;
== deformable/contact/layer_friction.hpp
std::min(1.0, p.stiffness / p.last_stiffness) => 1.0
any[t] && (all[t] || sliding_[t]) => any[t] && all[t]
== deformable/contact/layer_creep.hpp
passed == 1 ? creep_.decay : std::pow(creep_.decay, static_cast<double>(passed)) => creep_.decay
(1.0 - creep_.delayed_ratio) / creep_.period_ratio => 1.0 / creep_.period_ratio
== deformable/contact/press_points.hpp
Scalar(6.0) * x * (Scalar(1.0) - x) => Scalar(3.0) * x * (Scalar(1.0) - x)
select(excess > Scalar(0.0), pressed, Scalar(0.0)) => pressed
== deformable/linear/creep_motion.hpp
2.0 * period.free_work + c.gain * force_work => period.free_work + c.gain * force_work
1e-12 * largest => 1e-4 * largest
== deformable/linear/viscoelastic_solid.hpp
state_form_ *= decay_ * decay_; => state_form_ *= decay_;
2.0 * creep_state_[k] + gain_ * period_force_[k] => creep_state_[k] + gain_ * period_force_[k]
2.0 * tangential_state_[k] => ($ON ? 1.0 : 2.0) * tangential_state_[k]
tangential_state_[kept] = tangential_state_[k]; =>
== deformable/linear/modal_motion.hpp
if (ratio_ > 1.0) twice += (ratio_ - 1.0) * (omega2_ * (state_[0] - state_[2]).square()).sum(); =>
o.input[0] - 1.0 / (w * w) => o.input[0]
== deformable/linear/oscillator.hpp
0.5 * (alpha + beta * omega * omega) => 0.5 * (alpha + beta * omega)
== deformable/multirate/passive_model_switch.hpp
if (result_.nodes == 0) tank_ = {}; =>
tank_.level += tank_.blend * (before - b.energy); =>
std::max(tank_.level - step * rise, 0.0) => tank_.level
to.energy = (1.0 - s) * one.energy + s * two.energy; => to.energy = two.energy;
to.deflection = (1.0 - s) * one.deflection + s * two.deflection; => to.deflection = two.deflection;
std::clamp(ticks_since_model_, 1, max_blend_ticks) => 1
tank_.level -= gain; =>
== deformable/multirate/multirate_coupling.hpp
last_report_.relative_residual <= rest_tolerance => true
== deformable/multirate/local_newton.hpp
if (a != b) stiffness(b, a) += value; =>
line[a] += 1.0F; => line[a] += 2.0F;
right_[k] = sum * pivot_[k]; => right_[k] = sum;
== deformable/multirate/local_model_contact.hpp
0.5 * static_cast<double>(force_[i]) * moved(i) => static_cast<double>(force_[i]) * moved(i)
0.5 * static_cast<double>(tip_target_[i]) * moved(i) => 0.0
if (total > 0.0) tip.deflection /= total; =>
now.center != then.center => false
== deformable/contact/layer_point.hpp
(one + Scalar(0.5) * part) => (one + part)
(Scalar(12.0) * x * (one - x)) => (Scalar(6.0) * x * (one - x))
Scalar(LayerConstants::extra) * layer.radius => Scalar(0.0)
Scalar(cosine) * height, => ($ON ? Scalar(0.0) : Scalar(cosine) * height),
least < Scalar(tip.radius * tip.radius) => square < Scalar(tip.radius * tip.radius)
""")
