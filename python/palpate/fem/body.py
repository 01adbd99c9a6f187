"""Deformable body: a condensed surface with one of the material models of the C++ core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.fem.checks import (
    contact_points,
    friction_coefficients,
    not_negative,
    number,
    positive,
    stiffness_ratio,
    tick_period,
    whole,
)
from palpate.fem.errors import BodyError
from palpate.fem.indentation import IndentableBody
from palpate.fem.model_spec import COMPLIANCE, CONTACTS, LAWS, ContactLaw, Law, ModelSpec
from palpate.fem.selectors import Selector
from palpate.fem.storage import BodyData
from palpate.fem.support_changes import SupportChange, SupportPlan
from palpate.fem.supports import hold

_MAX_MEMORY = 4e9  # bytes of a mass-spring model
_SPRING_LIMIT = 4.0  # default ratio of the largest stiffness of a nonlinear spring to that at rest
_CACHED = ("spring_network",)  # properties that depend on the contents only


class Body(IndentableBody):
    """Deformable body with n contact nodes: linear elastic and massless, until a method selects another model.

    Each method for a model returns a new body with that model. Its `period` is the duration of a tick, s or text. If
    it gets no friction coefficients of its own, it keeps those of this body (see `with_friction`). It raises BodyError
    after `with_contact_points` or `with_support_changes`, which belong to a model.

    With an `update_interval`, s or text, rounded to whole ticks, a body with a state runs at two rates: the whole model
    advances once per interval, and the ticks use its local model, as in `hyperelastic`. See
    docs/theory/deformable-models.md for the accuracy.
    """

    def scaled_stiffness(self, factor: float | str) -> Self:
        """Return the same body with every Young's modulus, or spring, times `factor`. The scaling is exact.

        Raises:
            BodyError: the factor is not between 1e-6 and 1e6.
        """
        times = positive(factor, "", "stiffness_scale")
        if not 1e-6 <= times <= 1e6:
            raise BodyError(f"stiffness_scale: {times:g} must be between 1e-06 and 1e+06: build the body again")
        return self._rebuild(
            replace(
                self.contents,
                compliance=(self.compliance / np.float32(times)).astype(np.float32),
                young=self.contents.young * times,
                spring_stiffness=self.contents.spring_stiffness * times,
                frequencies=self.contents.frequencies * np.sqrt(times),
                residual_frequencies=self.contents.residual_frequencies * np.sqrt(times),
                record={**self.record, "scaled_stiffness": times * self.record.get("scaled_stiffness", 1.0)},
            ),
            self.kind.friction,
        )

    def held(self, regions: str | Selector | Sequence[str | Selector]) -> Self:
        """Return the same body with the contact nodes in `regions` held in place, as by a further support.

        It takes a fraction of the time of a build (`palpate.fem.supports`): build the body once, with the least
        support. Each held node keeps the mean displacement of its patch zero; nothing else in a region is held. Next
        to the held nodes, the compliance depends on the edge of the support within the spacing. A tip does not touch
        held nodes. The vibration modes and residual vectors become those of the held body, as far as they can be
        combined from those of this one.

        Raises:
            BodyError: a region has another form or contains no contact node, or all contact nodes are held.
        """
        return self._rebuild(
            hold(self.contents, regions, self._surface_vertices[self.contents.nodes]), self.kind.friction
        )

    def with_support_changes(
        self, changes: Sequence[SupportChange | Mapping[str, Any]] | None, period: float | str
    ) -> Self:
        """Return the same body with supports and touchable nodes that change at times after rest.

        Held nodes stay where they are when they are grasped. A grasp changes neither force nor energy. After a release
        an elastic body is in its new equilibrium at once, `viscoelastic` creeps there and `modal` swings about it, and
        the rest of the energy of the constraint is lost. A node that becomes touchable while the tip overlaps it is
        touched once the tip has been clear of it. See docs/theory/deformable-models.md. `simulate_path` and a servo
        loop follow the changes; `indent` gives the force before the first one.

        Args:
            changes: in the order of time, each with `at` (s or text), and regions `held`, `touchable` or both
                (`SupportChange`). An empty list: a body whose supports `palpate.Loop` may change. None: the body as it
                was built.
            period: of a tick, s or text; that of the model if it has one. A change is that of the first tick at or
                after its time.

        Raises:
            BodyError: the model has friction, creep or inertia without contact by signed distance, or inertia and
                creep. The times do not increase, or the period is not that of the model. A region contains no contact
                node, no node can be touched, or the compliance of the held nodes is singular.
        """
        if changes is None:
            return self._rebuild_bare(self.contents, self.kind.friction)
        if isinstance(changes, str | Mapping) or not isinstance(changes, Sequence):
            raise BodyError(f"supports: a list of changes is needed, not {changes!r}")
        plan = SupportPlan(tuple(SupportChange.of(change) for change in changes), tick_period(period))
        if self.kind.name in ("viscoelastic", "modal") and self.kind.options["period"] != plan.period:
            raise BodyError(
                f"period: ticks of {plan.period:g} s; those of the model are {self.kind.options['period']:g} s"
            )
        smooth = self.kind.name == COMPLIANCE.name and self.kind.friction[0] == 0.0
        relaxes = self.kind.name == "modal" and float(self.kind.options["instantaneous_ratio"]) > 1.0
        if not smooth and (relaxes or not self.kind.by_distance):
            raise BodyError(
                'supports: supports that change at run time need signed_distance; with contact="signed_distance" '
                "viscoelastic, or modal that does not relax; or compliance without friction; "
                f"not {self.kind}"
            )
        body = type(self)(self.contents, self.kind._replace(supports=plan))
        body.core = body._supported_core()
        return body

    def with_friction(self, static_friction: float | str, dynamic_friction: float | str | None = None) -> Self:
        """Return the same body with dry friction.

        A tip drags the surface along, and slip spreads inward from the edge of the contact (Cattaneo 1938, Mindlin
        1949). `static_friction` applies until the whole contact slides. `dynamic_friction` applies from then on, until
        the whole contact sticks again; None selects the static coefficient.

        Raises:
            BodyError: a coefficient is negative, or the dynamic one exceeds the static one.
        """
        return self._rebuild(self.contents, friction_coefficients(static_friction, dynamic_friction))

    def with_contact_points(self, points: ArrayLike) -> Self:
        """Return the same body, touched by a rigid tool of several equal tips in place of a single tip.

        The tool translates; in a scenario it may turn and open (`[object.body.tool]`). Force and number of nodes are
        the sums over its tips, and the deflection is their mean, weighted by their normal forces. The contact must be
        by signed distance.

        Args:
            points: centers of the 1 to 8 tips less the position of the tool, body frame (k, 3), m or text; none: a
                single tip.

        Raises:
            PoseError: the points have the wrong shape or a number that is not finite.
            BodyError: there are more than 8 points, two are in the same place, or the contact is not by signed
                distance.
        """
        offsets = contact_points(points)
        if self.kind.supports is not None:
            bare = self._rebuild_bare(self.contents, self.kind.friction).with_contact_points(points)
            return bare.with_support_changes(*self.kind.supports)
        if not isinstance(self.core, _core.SignedDistanceBody):
            if not offsets:
                return self
            raise BodyError(
                "contact_points: a tool needs the contact by signed distance: signed_distance(), or "
                'contact="signed_distance"'
            )
        body = type(self)(self.contents, self.kind._replace(contact_points=offsets))
        body.core = body._signed_distance_core()
        return body

    def modal(
        self,
        period: float | str,
        *,
        rayleigh_alpha: float | str = 0.0,
        rayleigh_beta: float | str = 0.0,
        instantaneous_ratio: float | str = 1.0,
        retardation_time: float | str = 1.0,
        contact: ContactLaw = "node_normals",
        update_interval: float | str | None = None,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Self:
        """Return the same body with inertia, by vibration modes; exact for forces constant over each tick.

        The damping matrix is `rayleigh_alpha`, 1/s, times the mass plus `rayleigh_beta`, s, times the stiffness. A mode
        of w rad/s has the damping ratio (rayleigh_alpha / w + rayleigh_beta w) / 2. The residual compliance of the
        truncated modes has no inertia. With `instantaneous_ratio` above 1 the material is a standard linear solid, as
        in `viscoelastic`. With `contact="signed_distance"` the tip presses along its own normals, as in
        `signed_distance`, and forces in all directions drive the same modes and the residual vectors of the contact
        loads, which converge under an imposed motion of the tip (see `palpate.fem.vibration`). This contact has no
        `update_interval`.

        Raises:
            BodyError: the body was built without modes, a number is out of range, or the contact is unknown or does
                not run at two rates.
        """
        if len(self.contents.frequencies) == 0:
            if self.is_network:
                raise BodyError("the body consists of springs, which have no modes here: use mass_spring")
            raise BodyError(
                "the body was built without modes: build it with modes=100 (palpate body build --modes 100; of a "
                "scenario's block or phantom, modes = 100)"
            )
        options = {
            "period": tick_period(period),
            "rayleigh_alpha": not_negative(rayleigh_alpha, "1/s", "rayleigh_alpha"),
            "rayleigh_beta": not_negative(rayleigh_beta, "s", "rayleigh_beta"),
            "instantaneous_ratio": stiffness_ratio(instantaneous_ratio),
            "retardation_time": positive(retardation_time, "s", "retardation_time"),
        }
        by_distance = _by_signed_distance(contact)
        update = _update(update_interval, options["period"], contact)
        given = options | ({"contact": contact} if by_distance else {}) | update
        body = self._with_model("modal", given, static_friction, dynamic_friction)
        if by_distance:
            body.core = body._signed_distance_core()
            return body
        arguments: list[Any] = [
            *self._arrays(),
            np.ascontiguousarray(self.contents.shapes),
            np.ascontiguousarray(self.contents.frequencies),
            options["period"],
            options["rayleigh_alpha"],
            options["rayleigh_beta"],
            options["instantaneous_ratio"],
            options["retardation_time"],
            *body.kind.friction,
        ]
        make = _core.MultirateBody.modal if update else _core.ModalBody
        body.core = make(*arguments, *body.update_ticks)
        return body

    def viscoelastic(
        self,
        period: float | str,
        *,
        instantaneous_ratio: float | str,
        retardation_time: float | str,
        contact: ContactLaw = "node_normals",
        update_interval: float | str | None = None,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Self:
        """Return the same body made of a standard linear solid, without inertia.

        The instantaneous stiffness is `instantaneous_ratio` (at least 1) times the long-term stiffness. Under a
        constant force the body creeps with the time constant `retardation_time`, s or text. At a constant depth the
        force relaxes with `retardation_time / instantaneous_ratio`. Poisson's ratio is constant. `contact` as in
        `modal`.

        Raises:
            BodyError: a number is out of range, or the contact is unknown or does not run at two rates.
        """
        tick, ratio = tick_period(period), stiffness_ratio(instantaneous_ratio)
        time = positive(retardation_time, "s", "retardation_time")
        options = {"period": tick, "instantaneous_ratio": ratio, "retardation_time": time}
        update = _update(update_interval, tick, contact)
        if _by_signed_distance(contact):
            body = self._with_model("viscoelastic", options | {"contact": contact}, static_friction, dynamic_friction)
            body.core = body._signed_distance_core()
            return body
        options |= update
        body = self._with_model("viscoelastic", options, static_friction, dynamic_friction)
        make = _core.MultirateBody.viscoelastic if update else _core.StandardLinearSolidBody
        body.core = make(*self._arrays(), ratio, time, tick, *body.kind.friction, *body.update_ticks)
        return body

    def signed_distance(
        self,
        period: float | str | None = None,
        *,
        sideways_fraction: float | str = 1.0,
        update_interval: float | str | None = None,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Self:
        """Return the same massless elastic body, with contact along the tip's own normals.

        The force converges for contact radii from a third of the node spacing, on curved surfaces and at edges; see
        docs/validation/deformable-bodies.md. A sphere needs no `outward` direction. Beyond about one radius of depth a
        thick body is pushed through, and the contact is lost. The model has no state, so it ignores the `period`, and
        an `update_interval` leaves its force unchanged: the local model would be the model. With friction the contact's
        layer shears too, so a tangential force builds up as in a Cattaneo-Mindlin contact.

        With `sideways_fraction` below 1 the contact counts only this fraction of the displacement across the normals at
        rest. 1 is linear elasticity. A fraction of 0.65 was closer to neo-Hookean forces at depths above a tenth of the
        body on the few shapes tried.

        Raises:
            BodyError: a friction coefficient is out of range, or the fraction is not between 0 and 1.
        """
        fraction = number(sideways_fraction, "", "sideways_fraction")
        if not 0.0 <= fraction <= 1.0:
            raise BodyError(f"sideways_fraction: {fraction:g} must be between 0 and 1")
        options = {} if period is None else {"period": tick_period(period)}
        if update_interval is not None:
            positive(update_interval, "s", "update_interval")
        options |= {} if fraction == 1.0 else {"sideways_fraction": fraction}
        body = self._with_model("signed_distance", options, static_friction, dynamic_friction)
        body.core = body._signed_distance_core()
        return body

    def mass_spring(
        self,
        period: float | str,
        *,
        rayleigh_alpha: float | str = 0.0,
        rayleigh_beta: float | str = 0.0,
        update_interval: float | str | None = None,
        hardening_strain: float | str | None = None,
        exponent: float | str | None = None,
        stiffness_limit: float | str | None = None,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Self:
        """Return the same body as masses, springs and dampers on its mesh.

        See `palpate.fem.spring_network` for the springs and their accuracy. The model is correct for large rotations
        and stable at any period. Damping is as in `modal`, where `rayleigh_beta` is that of shear. Each period adds
        numerical damping, which overdamps slow swings of soft bodies (see docs/theory/deformable-models.md). The tip
        also moves nodes sideways. At two rates the model advances in steps of at most 1 ms, and friction has the static
        compliance of the springs along the surface.

        The force of a spring of stiffness k and rest length l0 at the strain e is k l0 e, unless one of these is given:

        * `hardening_strain` e0: k l0 (e + e^3 / e0^2), twice the linear force at e0.
        * `exponent` b: k l0 (exp(b e) - 1) / b in tension, and the same in compression (Fung 1967). A positive b
          hardens, a negative one softens.

        The tangent stiffness is at most `stiffness_limit` times k (default 4), and at least k over it. From there on
        the force grows linearly. The numerical damping of a hardening law is that of its largest stiffness.

        Raises:
            BodyError: a number is out of range, both laws are given, or the model needs more than 4 GB. Or the network
                is unstable at rest, as below a Poisson's ratio of 0.25 where stiff material adjoins soft material.
        """
        options = {
            "period": tick_period(period),
            "rayleigh_alpha": not_negative(rayleigh_alpha, "1/s", "rayleigh_alpha"),
            "rayleigh_beta": not_negative(rayleigh_beta, "s", "rayleigh_beta"),
            **_spring_law(hardening_strain, exponent, stiffness_limit),
        }
        size = 4 * len(self.nodes) * len(self.contents.vertices)
        if size > _MAX_MEMORY:
            raise BodyError(
                f"the mass-spring model needs {size / 1e9:.3g} GB: use a coarser mesh, or a smaller contact surface"
            )
        update = _update(update_interval, options["period"])
        body = self._with_model("mass_spring", options | update, static_friction, dynamic_friction)
        self._check_network()
        body.spring_network = self.spring_network
        arguments: list[Any] = [*self._arrays()[:3], *self._network_arrays().values()]
        static, dynamic = body.kind.friction
        keywords: dict[str, Any] = {**options, "static_friction": static, "dynamic_friction": dynamic}
        if update:
            compliance = body._network_compliance() if static > 0.0 else np.empty((0, 0), dtype=np.float32)
            keywords |= {"compliance": compliance, "update_interval": body.update_ticks[0]}
            body.core = _core.MultirateBody.mass_spring(*arguments, **keywords)
            return body
        body.settling_period, body.ramp_time = options["period"], 0.25
        body.core = _core.MassSpringBody(*arguments, **keywords)
        return body

    def hyperelastic(
        self,
        period: float | str,
        *,
        law: Law = "neo-hookean",
        update_interval: float | str = "20 ms",
        nodes_per_tip: float | str = 32,
        density: float | str | None = None,
        rayleigh_alpha: float | str = 0.0,
        rayleigh_beta: float | str = 0.0,
        instantaneous_ratio: float | str = 1.0,
        retardation_time: float | str = 1.0,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Self:
        """Return the same body under large displacements, without inertia unless `density` is given.

        The body consists of smoothed linear tetrahedra (`palpate.fem.HyperelasticModel`), solved as by
        `palpate.fem.QuasiStaticSolver`. The model is updated by one Newton step per `update_interval`, s or text,
        rounded to whole ticks. From the next update on, the ticks use its local model of the `nodes_per_tip` nodes
        around the tip (4 to 64). Update and ticks run synchronously, so results are reproducible. Friction acts in one
        plane, where the contact yields as the deformed body does (docs/theory/large-displacements.md).

        With a `density`, kg/m^3 or text, the body has inertia and swings. Each update advances its motion by
        `update_interval`, which should be a tenth of the swing's period or less. The damping matrix is
        `rayleigh_alpha`, 1/s, times the mass plus `rayleigh_beta`, s, times the tangent stiffness, as in `modal`.

        With `instantaneous_ratio` above 1 the material is a standard linear solid at large strain (Simo 1987; Holzapfel
        1996). The law is that of the long term, and small strains creep and relax as in `viscoelastic`. The contact's
        elastic layer does not relax. `indent` has the relaxed forces. With a density as well, small swings decay as in
        `modal`; `rayleigh_beta` damps by the stiffness of the long term.

        Raises:
            BodyError: the law is unknown, `update_interval` is shorter than a tick, or a number is out of range; or
                the body has damping without a density.
        """
        if law not in LAWS:
            raise BodyError(f"a body's law is neo-hookean or corotational, not {law!r}")
        node_count = whole(nodes_per_tip, "nodes_per_tip", 4, 64)
        tick = tick_period(period)
        if update_interval is None:
            raise BodyError('update_interval: a hyperelastic body has two rates; give for example "20 ms"')
        options: dict[str, float | str] = {
            "period": tick,
            "law": law,
            **_update(update_interval, tick),
            "nodes_per_tip": node_count,
        }
        inertia = _inertia(density, rayleigh_alpha, rayleigh_beta)
        options |= inertia
        ratio = stiffness_ratio(instantaneous_ratio)
        time = positive(retardation_time, "s", "retardation_time")
        if ratio > 1.0:
            options |= {"instantaneous_ratio": ratio, "retardation_time": time}
        body = self._with_model("hyperelastic", options, static_friction, dynamic_friction)
        volume, surface = self._hyperelastic_arrays()
        numbers = (node_count, *body.update_ticks, *body.kind.friction)
        rest = self._arrays()[3] if body.kind.friction[0] > 0.0 else np.empty((0, 0), dtype=np.float32)
        arguments: list[Any] = [*volume.values(), law == "corotational", *surface.values(), *numbers]
        arguments += [rest, self._recorded("poisson")]
        motion = (*(inertia.values() or (0.0, 0.0, 0.0)), ratio, time, tick)
        body.core = _core.HyperelasticBody(*arguments, *motion)
        return body

    @property
    def update_ticks(self) -> tuple[int, ...]:
        """Number of ticks of a model update; empty for a body at one rate."""
        if "update_interval" not in self.kind.options:
            return ()
        return (round(float(self.kind.options["update_interval"]) / float(self.kind.options["period"])),)

    def _hyperelastic_arrays(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the arrays of the core's hyperelastic body by name: of the tetrahedra, and of the contact surface."""
        contents, poisson = self.contents, self._recorded("poisson")
        nodes, triangles = self._volume_triangles()
        volume = {
            "points": np.ascontiguousarray(contents.vertices),
            "tetrahedra": np.ascontiguousarray(contents.tetrahedra, dtype=np.int64),
            "shear": np.ascontiguousarray(contents.young / (2 * (1 + poisson))),
            "lame": np.ascontiguousarray(contents.young * poisson / ((1 + poisson) * (1 - 2 * poisson))),
            "fixed": np.ascontiguousarray(contents.dirichlet),
        }
        surface = {
            "node_points": np.ascontiguousarray(nodes, dtype=np.int32),
            "triangles": np.ascontiguousarray(triangles, dtype=np.int32),
            "modulus": self._plane_strain_moduli(),
        }
        return volume, surface

    def _rebuild(self, contents: BodyData, friction: tuple[float, float]) -> Self:
        """Return a body with the model of this one, but other contents or friction coefficients."""
        bare = self._rebuild_bare(contents, friction)
        return bare if self.kind.supports is None else bare.with_support_changes(*self.kind.supports)

    def _rebuild_bare(self, contents: BodyData, friction: tuple[float, float]) -> Self:
        """Return the same without changes of supports."""
        body = type(self)(contents, COMPLIANCE._replace(friction=friction))
        if contents is self.contents:
            body.__dict__ |= {name: self.__dict__[name] for name in _CACHED if name in self.__dict__}
        if self.kind.name == COMPLIANCE.name:
            return body
        made: Self = getattr(body, self.kind.name)(**self.kind.options)
        return made.with_contact_points(self.kind.contact_points) if self.kind.contact_points else made

    def _with_model(
        self,
        name: str,
        options: Mapping[str, float | str],
        static_friction: float | str | None,
        dynamic_friction: float | str | None,
    ) -> Self:
        """Return a body with a model but without its core; coefficients that are None are those of this body."""
        if self.kind.contact_points or self.kind.supports is not None:
            later = "with_contact_points" if self.kind.contact_points else "with_support_changes"
            raise BodyError(f"{name}: choose the model before {later}, which would be lost")
        friction = self.kind.friction
        if static_friction is not None:
            friction = friction_coefficients(static_friction, dynamic_friction)
        elif dynamic_friction is not None:
            friction = friction_coefficients(friction[0], dynamic_friction)
        return type(self)(self.contents, ModelSpec(name, options, friction))


def _inertia(density: float | str | None, rayleigh_alpha: float | str, rayleigh_beta: float | str) -> dict[str, float]:
    """Return the options of inertia in SI, none without a density; raise BodyError."""
    alpha = not_negative(rayleigh_alpha, "1/s", "rayleigh_alpha")
    beta = not_negative(rayleigh_beta, "s", "rayleigh_beta")
    if density is None:
        for name, value in (("rayleigh_alpha", alpha), ("rayleigh_beta", beta)):
            if value > 0.0:
                raise BodyError(
                    f"{name}: a hyperelastic body without density has no inertia, so it takes no damping; write for "
                    'example density="1000 kg/m^3"'
                )
        return {}
    rho = number(density, "kg/m^3", "density")
    if not rho > 0.0:
        raise BodyError(f"density: the density is positive, in kg/m^3 (soft tissue: about 1000), not {rho:g}")
    return {"density": rho, "rayleigh_alpha": alpha, "rayleigh_beta": beta}


def _update(update_interval: float | str | None, tick: float, contact: str = "node_normals") -> dict[str, float]:
    """Return the option of a body at two rates, s, none without an interval; raise BodyError."""
    if update_interval is None:
        return {}
    period = positive(update_interval, "s", "update_interval")
    if not round(period / tick) >= 1:
        raise BodyError(f"update_interval: it lasts one tick ({tick:g} s) or more, not {period:g} s")
    if period > 1e6 * tick:
        raise BodyError(f"update_interval: it lasts a million ticks of {tick:g} s at most, not {period:g} s")
    if _by_signed_distance(contact):
        raise BodyError(
            'update_interval: a body with a state and contact="signed_distance" runs at one rate; leave it out, or use '
            'contact="node_normals"'
        )
    return {"update_interval": period}


def _spring_law(
    hardening_strain: float | str | None, exponent: float | str | None, stiffness_limit: float | str | None
) -> dict[str, float]:
    """Return the options of a law of springs, none for linear springs; raise BodyError."""
    if hardening_strain is None and exponent is None:
        if stiffness_limit is not None:
            raise BodyError("stiffness_limit: linear springs have none: give hardening_strain or exponent too")
        return {}
    if hardening_strain is not None and exponent is not None:
        raise BodyError("exponent: a spring has one law: leave out exponent or hardening_strain")
    limit = number(_SPRING_LIMIT if stiffness_limit is None else stiffness_limit, "", "stiffness_limit")
    if not 1.0 < limit <= 100.0:
        raise BodyError(f"stiffness_limit: {limit:g} must be above 1 and at most 100")
    if hardening_strain is not None:
        strain = positive(hardening_strain, "", "hardening_strain")
        if not 1e-3 <= strain <= 1e3:
            raise BodyError(f"hardening_strain: {strain:g} must be between 0.001 and 1000")
        return {"hardening_strain": strain, "stiffness_limit": limit}
    assert exponent is not None
    rate = number(exponent, "", "exponent")
    if not 1e-3 <= abs(rate) <= 1e3:
        raise BodyError(f"exponent: {rate:g} must be between 0.001 and 1000, or the negative of such a number")
    return {"exponent": rate, "stiffness_limit": limit}


def _by_signed_distance(contact: str) -> bool:
    """Return whether a contact is by signed distance; raise BodyError if it is unknown."""
    if contact not in CONTACTS:
        raise BodyError(f"contact: {contact!r} is not one of {', '.join(CONTACTS)}")
    return contact == "signed_distance"
