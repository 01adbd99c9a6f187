"""A body that yields where it is touched."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.optimize import nnls

from palpate import _core
from palpate.contact.diagnosis import lengths as sizes
from palpate.contact.mesh import Mesh
from palpate.errors import PoseError
from palpate.fem.checks import (
    check_finite,
    check_tip,
    directions,
    friction,
    lengths,
    not_negative,
    point_of,
    positive,
    press_depth,
    stiffening,
    tick_period,
    whole,
)
from palpate.fem.errors import BodyError, BodyWarning, lost, press_to_rest
from palpate.fem.free_form import FreeFormLaw, calibrate
from palpate.fem.model_spec import PLAIN, ModelSpec
from palpate.fem.spring_network import SpringNetwork, build_network, patches
from palpate.fem.storage import BodyData, read, write
from palpate.fem.volume import Volume

__all__ = ["Body", "ContactHistory", "Indentation", "Law"]

Shape = Literal["sphere", "flat"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Law = Literal["neo-hookean", "corotational"]
Core = (
    _core.ComplianceBody
    | _core.ModalBody
    | _core.StandardLinearSolidBody
    | _core.MassSpringBody
    | _core.FreeFormBody
    | _core.HyperelasticBody
)


class Indentation(NamedTuple):
    """What a tip that presses feels, and how the surface moves."""

    force: Array  # of the body on the tip (3,), N
    displacement: Array  # of the nodes (n, 3), m


class ContactHistory(NamedTuple):
    """What a tip feels along a path of m places."""

    force: Array  # of the body on the tip (m, 3), N
    deflection: Array  # of the pressed patch, weighted by its forces (m, 3), m
    energy: Array  # stored (m,), J
    nodes: Indices  # pressed (m,)
    friction: Array  # the part of the force that drags along the surface (m, 3), N


class Body:
    """The touchable surface of an elastic solid: n nodes, and how far each moves under a force on each."""

    def __init__(self, contents: BodyData, kind: ModelSpec = PLAIN) -> None:
        self.contents = contents
        self.kind = kind
        self.settling_period: float | None = None  # period of a lattice, which `indent` lets come to rest, s
        self.ramp_time = 0.0  # how long it takes for each radius that a tip goes in, s

    @classmethod
    def load(cls, path: str | Path) -> Body:
        """Read a body that `palpate body build` wrote; BodyError if it is not one, or not whole."""
        return cls(read(path))

    def save(self, path: str | Path) -> Path:
        """Write the body (.h5), whole or not at all; what it is made of, not of which kind it is, nor its friction."""
        return write(self.contents, path)

    def __repr__(self) -> str:
        x, y, z = np.ptp(self.points, axis=0).tolist()
        modes = len(self.contents.frequencies)
        counts = f"{len(self.nodes)} touchable nodes, {modes} modes" if modes else f"{len(self.nodes)} touchable nodes"
        return f"<Body: {self.kind}; {counts}, {sizes((x, y, z))}, of {self.record['source']}>"

    @property
    def points(self) -> Array:
        """Of the whole surface at rest (s, 3), m."""
        return self.contents.points

    @property
    def triangles(self) -> Indices:
        """Of the whole surface (k, 3), anticlockwise seen from outside."""
        return self.contents.triangles

    @property
    def nodes(self) -> Array:
        """Places at rest of the nodes that carry contact (n, 3), m."""
        return self.contents.points[self.contents.nodes]

    @property
    def normals(self) -> Array:
        """Outward unit normals at the nodes (n, 3)."""
        return self.contents.normals

    @property
    def compliance(self) -> NDArray[np.float32]:
        """Displacement of each node by force on each (3n, 3n), m/N, row 3 x node + axis."""
        return self.contents.compliance

    @property
    def record(self) -> Mapping[str, Any]:
        """How it was made: inputs, sizes, times, versions."""
        return self.contents.record

    @property
    def extent(self) -> float:
        """Diagonal of the box around it, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def surface(self) -> Mesh:
        """The part of the surface that can be touched, as a mesh."""
        used, faces = self._touchable
        return Mesh(self.points[used], faces.reshape(-1, 3), open=True, mend=False)

    def on_surface(self, values: ArrayLike) -> Array:
        """Return what nodes have (n, ...) at the vertices of `surface` (v, ...): zero at those that are fixed.

        `body.surface.vertices + body.on_surface(displacement)` is where they are when it is pressed.

        Raises:
            BodyError: it is not one value, or one row, for each node.
        """
        each = np.asarray(values, dtype=float)
        if each.ndim == 0 or len(each) != len(self.nodes):
            raise BodyError(f"one value, or row, for each of the {len(self.nodes)} nodes is needed, not {each.shape}")
        whole = np.zeros((len(self.points), *each.shape[1:]))
        whole[self.contents.nodes] = each
        return np.asarray(whole[self._touchable[0]])

    @cached_property
    def volume(self) -> Volume:
        """The mesh that it was made from."""
        return Volume(self.contents.vertices, self.contents.tetrahedra, str(self.record["source"]))

    @cached_property
    def shares(self) -> sparse.csr_matrix:
        """What each vertex of the mesh (p) has in the mean over each node's patch (n, p)."""
        begin, vertices, shares = self._patches()
        return sparse.csr_matrix((shares, vertices, begin), shape=(len(self.nodes), len(self.contents.vertices)))

    @cached_property
    def spring_network(self) -> SpringNetwork:
        """The masses and springs of `mass_spring`; a few seconds for thousands of vertices."""
        density = self._recorded("density_kg_per_m3")
        return build_network(self.volume, self.contents.young, self._recorded("poisson"), density)

    @cached_property
    def core(self) -> Core:
        """The contact of one tip, in C++."""
        return _core.ComplianceBody(*self._arrays(), *self.kind.friction)

    def scaled_stiffness(self, factor: float | str) -> Body:
        """Return the same body, of the same kind, of a material `factor` times as stiff everywhere, which is exact.

        Raises:
            BodyError: the factor is not between a millionth and a million.
        """
        times = positive(factor, "", "stiffness_scale")
        if not 1e-6 <= times <= 1e6:
            raise BodyError(
                f"stiffness_scale: {times:g}; a body is a millionth to a million times as stiff as it was built"
            )
        return self._alike(
            replace(
                self.contents,
                compliance=(self.compliance / np.float32(times)).astype(np.float32),
                young=self.contents.young * times,
                frequencies=self.contents.frequencies * np.sqrt(times),
                record={**self.record, "scaled_stiffness": times * self.record.get("scaled_stiffness", 1.0)},
            ),
            self.kind.friction,
        )

    def with_friction(self, static_friction: float | str, dynamic_friction: float | str | None = None) -> Body:
        """Return the same body, of the same kind, with dry friction; `dynamic_friction` is as the static one if None.

        A tip drags the surface along and slips under it from the edge of the contact inwards (Cattaneo 1938, Mindlin
        1949). `static_friction` counts until all of the contact slides, `dynamic_friction` from then on, until all of
        it holds again. A kind that is made of a rough body is as rough, unless it is given numbers of its own.

        Raises:
            BodyError: a coefficient is negative, or the dynamic one is above the static one.
        """
        return self._alike(self.contents, friction(static_friction, dynamic_friction))

    def _alike(self, contents: BodyData, coefficients: tuple[float, float]) -> Body:
        """Return a body of the same kind: of other contents, or with other coefficients of friction."""
        plain = Body(contents, PLAIN._replace(friction=coefficients))
        if contents is self.contents:  # what took time to find
            plain.__dict__ |= {
                name: self.__dict__[name] for name in ("spring_network", "free_form_law") if name in self.__dict__
            }
        if self.kind.name == PLAIN.name:
            return plain
        made: Body = getattr(plain, self.kind.name)(**self.kind.options)
        return made

    def _kind(
        self,
        name: str,
        options: Mapping[str, float | str],
        static_friction: float | str | None,
        dynamic_friction: float | str | None,
    ) -> ModelSpec:
        """Return the kind of a body that is made of this one: with its friction where none is given."""
        if static_friction is not None:
            return ModelSpec(name, options, friction(static_friction, dynamic_friction))
        mine = self.kind.friction
        return ModelSpec(name, options, mine if dynamic_friction is None else friction(mine[0], dynamic_friction))

    def modal(
        self,
        period: float | str,
        *,
        rayleigh_alpha: float | str = 0.0,
        rayleigh_beta: float | str = 0.0,
        instantaneous_ratio: float | str = 1.0,
        retardation_time: float | str = 1.0,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Body:
        """Return the same body with inertia, for ticks of `period`, s or text; exact for forces held over each.

        Rayleigh damping: `rayleigh_alpha`, 1/s, times the mass and `rayleigh_beta`, s, times the stiffness. A mode of
        w rad/s has the damping ratio (rayleigh_alpha / w + rayleigh_beta w) / 2. The compliance that the modes leave
        out has no inertia. With `instantaneous_ratio` above 1 the material is a standard linear solid, as in
        `viscoelastic`. Friction is as in `with_friction`.

        Raises:
            BodyError: the body was built without modes, or a number is impossible.
        """
        if len(self.contents.frequencies) == 0:
            raise BodyError(
                "the body was built without modes: build it with modes=100 (palpate body build --modes 100; of a "
                "scenario's block or phantom, modes = 100)"
            )
        tick, most, late = (
            tick_period(period),
            stiffening(instantaneous_ratio),
            positive(retardation_time, "s", "retardation_time"),
        )
        damping = _damping(rayleigh_alpha, rayleigh_beta)
        options = {
            "period": tick,
            "rayleigh_alpha": damping[0],
            "rayleigh_beta": damping[1],
            "instantaneous_ratio": most,
            "retardation_time": late,
        }
        moving = Body(self.contents, self._kind("modal", options, static_friction, dynamic_friction))
        shapes = np.ascontiguousarray(self.contents.shapes)
        moving.core = _core.ModalBody(
            *self._arrays(),
            shapes,
            np.ascontiguousarray(self.contents.frequencies),
            tick,
            *damping,
            most,
            late,
            *moving.kind.friction,
        )
        return moving

    def viscoelastic(
        self,
        period: float | str,
        *,
        instantaneous_ratio: float | str,
        retardation_time: float | str,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Body:
        """Return the same body made of a standard linear solid, for ticks of `period`, s or text.

        Under a step it is `instantaneous_ratio` (at least 1) times as stiff as in the long term. Under a held force it
        creeps there with the time constant `retardation_time`, s or text; at a held depth the force relaxes with
        `retardation_time / instantaneous_ratio`. Poisson's ratio stays. Friction is as in `with_friction`.

        Raises:
            BodyError: a number is impossible.
        """
        tick, most, late = (
            tick_period(period),
            stiffening(instantaneous_ratio),
            positive(retardation_time, "s", "retardation_time"),
        )
        options = {"period": tick, "instantaneous_ratio": most, "retardation_time": late}
        viscous = Body(self.contents, self._kind("viscoelastic", options, static_friction, dynamic_friction))
        viscous.core = _core.StandardLinearSolidBody(*self._arrays(), most, late, tick, *viscous.kind.friction)
        return viscous

    def mass_spring(
        self,
        period: float | str,
        *,
        rayleigh_alpha: float | str = 0.0,
        rayleigh_beta: float | str = 0.0,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Body:
        """Return the same body as masses, springs and dampers on its mesh, for ticks of `period`, s or text.

        See `palpate.fem.spring_network` for what its springs are and how near they come; right for large turns, and
        stable at any period. Damping as in `modal`, `rayleigh_beta` that of shear; half a period's is added to it (see
        docs/bodies.md). Friction is as in `with_friction`; here what presses also moves nodes sideways.

        Raises:
            BodyError: a number is impossible, or the network would take more than 4 GB.
        """
        tick, damping = tick_period(period), _damping(rayleigh_alpha, rayleigh_beta)
        options = {"period": tick, "rayleigh_alpha": damping[0], "rayleigh_beta": damping[1]}
        size = 4 * len(self.nodes) * len(self.contents.vertices)
        if size > 4e9:
            raise BodyError(f"the lattice would take {size / 1e9:.3g} GB: take a coarser mesh, or touch less of it")
        springy = Body(self.contents, self._kind("mass_spring", options, static_friction, dynamic_friction))
        springy.spring_network = self.spring_network
        springy.settling_period, springy.ramp_time = tick, 0.25
        net, (nodes, normals, areas, _), (begin, vertices, shares) = (
            self.spring_network,
            self._arrays(),
            self._patches(),
        )
        springy.core = _core.MassSpringBody(
            nodes,
            normals,
            areas,
            net.places,
            net.masses,
            np.ascontiguousarray(self.contents.held),
            np.ascontiguousarray(net.springs, dtype=np.int32),
            net.stiffness,
            np.ascontiguousarray(net.tetrahedra, dtype=np.int32),
            net.pressure,
            begin,
            vertices,
            shares,
            tick,
            *damping,
            *springy.kind.friction,
        )
        return springy

    @cached_property
    def tangential_compliance(self) -> tuple[float, float]:
        """How it yields along its surface: (ratio, sway, m/N), so that T = ratio C + sway, with C along the normals.

        Fitted to the compliance of 16 nodes near each of 16, both directions alike, by least squares, neither below 0.
        """
        spots = np.unique(np.linspace(0, len(self.nodes) - 1, 16).astype(int))
        normal, along = [], []
        for spot in spots:
            near = np.argsort(np.linalg.norm(self.nodes - self.nodes[spot], axis=1))[:16]
            rows = (3 * near[:, None] + np.arange(3)).ravel()
            blocks = self.compliance[np.ix_(rows, rows)].astype(float).reshape(len(near), 3, len(near), 3)
            out = self.normals[spot]
            one = np.einsum("a,iajb,b->ij", out, blocks, out)
            normal.append(one.ravel())
            along.append((np.einsum("iaja->ij", blocks) - one).ravel() / 2.0)
        one, two = np.concatenate(normal), np.concatenate(along)
        scale = float(np.abs(one).max())
        fit, _ = nnls(np.stack([one, np.full_like(one, scale)], axis=1), two)
        return float(fit[0]), float(fit[1]) * scale

    @cached_property
    def free_form_law(self) -> FreeFormLaw:
        """The law of force of `free_form`, calibrated on the compliance."""
        return self._free_form_law(None)

    def _free_form_law(self, control_spacing: float | None) -> FreeFormLaw:
        return calibrate(self.nodes, self.normals, self.contents.areas, self.compliance, control_spacing)

    def free_form(
        self,
        period: float | str | None = None,
        *,
        control_spacing: float | str | None = None,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Body:
        """Return the same body as a free-form deformation with a law of force: the cheapest kind, and the crudest.

        See `palpate.fem.free_form` for the law, which is calibrated on this body's compliance. There is no state, so
        the `period` means nothing. `control_spacing` of the control points, m or text; that which fits best if None:
        from a quarter of the nodes' distance, below which no two nodes share a control point, to the body's extent.
        Friction is as in `with_friction`.

        Raises:
            BodyError: a number is impossible.
        """
        options = {} if period is None else {"period": tick_period(period)}
        if control_spacing is None:
            law = self.free_form_law
        else:
            options["control_spacing"] = wide = positive(control_spacing, "m", "control_spacing")
            least = 0.25 * float(np.sqrt(self.contents.areas.mean()))
            if not least <= wide <= self.extent:
                raise BodyError(
                    f"control_spacing: {1e3 * wide:g} mm; it must lie between {1e3 * least:.3g} mm, a quarter of the "
                    f"nodes' distance, and the body's extent of {1e3 * self.extent:.3g} mm"
                )
            law = self._free_form_law(wide)
        shaped = Body(self.contents, self._kind("free_form", options, static_friction, dynamic_friction))
        shaped.free_form_law = law
        shaped.core = _core.FreeFormBody(*self._arrays()[:3], *law, *shaped.kind.friction)
        return shaped

    def hyperelastic(
        self,
        period: float | str,
        *,
        law: Law = "neo-hookean",
        slow_step: float | str = "20 ms",
        near: float | str = 32,
        static_friction: float | str | None = None,
        dynamic_friction: float | str | None = None,
    ) -> Body:
        """Return the same body under large displacements, without inertia, for ticks of `period`, s or text.

        Linear tetrahedra on the body's mesh (`palpate.fem.HyperelasticModel`), solved as by
        `palpate.fem.QuasiStaticSolver`. Every `slow_step`, s or text, rounded to whole ticks, makes one step towards
        equilibrium. The ticks from the next one on use its snapshot of the `near` nodes around the tip (4 to 64). Both
        run in turn, so results are reproducible. Friction is as in `with_friction`, but in one plane, where the body
        yields by `tangential_compliance`.

        Raises:
            BodyError: the law is unknown, a slow step is shorter than a tick, or a number is impossible.
        """
        if law not in ("neo-hookean", "corotational"):
            raise BodyError(f"a body's law is neo-hookean or corotational, not {law!r}")
        covered = whole(near, "near", 4, 64)
        tick, slow = tick_period(period), positive(slow_step, "s", "slow_step")
        if not round(slow / tick) >= 1:
            raise BodyError(f"slow_step: it lasts one tick ({tick:g} s) or more, not {slow:g} s")
        if slow > 1e6 * tick:
            raise BodyError(f"slow_step: it lasts a million ticks of {tick:g} s at most, not {slow:g} s")
        options = {"period": tick, "law": law, "slow_step": slow, "near": covered}
        contents, poisson = self.contents, self._recorded("poisson")
        on_surface = np.unique(self.volume.surface)
        begin, vertices, shares = self._patches()
        large = Body(contents, self._kind("hyperelastic", options, static_friction, dynamic_friction))
        large.core = _core.HyperelasticBody(
            np.ascontiguousarray(contents.vertices),
            np.ascontiguousarray(contents.tetrahedra, dtype=np.int64),
            np.ascontiguousarray(contents.young / (2 * (1 + poisson))),
            np.ascontiguousarray(contents.young * poisson / ((1 + poisson) * (1 - 2 * poisson))),
            np.ascontiguousarray(contents.held),
            law == "corotational",
            np.ascontiguousarray(on_surface[contents.nodes], dtype=np.int32),
            np.ascontiguousarray(contents.areas),
            begin,
            vertices,
            shares,
            np.ascontiguousarray(on_surface[self.triangles[contents.touchable]], dtype=np.int32),
            covered,
            round(slow / tick),
            *self.tangential_compliance,
            *large.kind.friction,
        )
        return large

    def _recorded(self, key: str) -> float:
        try:
            return float(self.record[key])
        except (KeyError, TypeError, ValueError):
            raise BodyError(f"the body's file does not tell {key}, which this kind needs: build it again") from None

    @cached_property
    def _touchable(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The points of `surface` among all, and the corners of its triangles among those."""
        return np.unique(self.triangles[self.contents.touchable], return_inverse=True)

    def _patches(self) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
        on_surface = np.unique(self.volume.surface)
        triangles = on_surface[self.triangles[self.contents.touchable]]
        return patches(self.volume.points, triangles, on_surface[self.contents.nodes])

    def _arrays(self) -> tuple[Array, Array, Array, NDArray[np.float32]]:
        nodes, normals, areas = (np.ascontiguousarray(a) for a in (self.nodes, self.normals, self.contents.areas))
        return nodes, normals, areas, np.ascontiguousarray(self.compliance)

    def indent(
        self, point: ArrayLike, radius: float | str, depth: float | str, *, tip: Shape = "sphere"
    ) -> Indentation:
        """Press a rigid tip `depth` into the body along the normal at the surface's nearest point to `point`.

        Args:
            point: (3,), m or text such as "5 mm".
            radius: of the sphere, or of the flat end of a rod, m or text such as "5 mm".
            depth: of the tip's lowest point or end under the surface at rest, m or text; not negative.
            tip: "sphere" or "flat".

        Returns:
            The force on the tip (3,), N, and the displacement of the body's nodes (n, 3), m, both at rest: of `modal`
            and `viscoelastic`, those of the body without inertia and creep. An indentation from rest has no friction,
            except that of a mass-spring model, whose nodes move sideways. Displacements are taken as small against the
            body and the tip. Fewer than four pressed nodes cause a warning.

        Raises:
            PoseError: the point is not three finite numbers.
            BodyError: the point is farther from the body than that is across, the press deeper than that or negative,
                the radius is not positive, the tip is neither shape, more nodes lie under it than are looked at (128),
                or a lattice or a body under large displacements gives way so far that the tip loses it, or the latter
                does not come to rest.
        """
        if isinstance(self.core, _core.ModalBody | _core.StandardLinearSolidBody):
            return Body(self.contents).indent(point, radius, depth, tip=tip)
        x = point_of(point)
        size, deep = positive(radius, "m", "radius"), press_depth(depth)
        if deep > 1000 * size:
            raise BodyError(f"radius: {size:g} m; a tip that goes {deep:g} m deep has at least a thousandth of that")
        at, facet = self.surface.nearest(x[None])
        apart = float(np.linalg.norm(at[0] - x))
        if apart > self.extent:
            raise BodyError(
                f"the point lies {apart:.3g} m from the body, which is {self.extent:.3g} m across: points are in m"
            )
        if deep > self.extent:
            raise BodyError(f"depth: {deep:g} m is more than the body is across, {self.extent:.3g} m: lengths are in m")
        a, b, c = self.surface.vertices[self.surface.triangles[facet[0]]]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        centre = at[0] + normal * ((size if tip == "sphere" else 0.0) - deep)
        self.core.reset()
        radii = deep / size
        if isinstance(self.core, _core.HyperelasticBody):
            history = self._rest(self.core, centre, normal, deep, size, tip)
            return self._end_of_press(history, deep)
        if self.settling_period is None:  # a deep press goes in by less than the radius at a time
            steps = int(np.ceil(2.0 * radii)) if radii > 1.0 else 1
        else:  # from one place of rest to the next
            steps = int(np.ceil(max(radii, 1.0) * self.ramp_time / self.settling_period))
        way = centre + np.outer(deep * (1.0 - np.arange(1, steps + 1) / steps), normal)
        history = self.simulate_path(way, size, outward=normal, tip=tip)
        if self.settling_period is not None:
            held = 1e3 * deep * (np.flatnonzero(history.nodes) + 1) / steps
            history = self._settle(centre, size, normal, tip, self.settling_period)
            if len(held) > 0 and history.nodes[-1] == 0:
                raise BodyError(lost(1e3 * deep, held[-1]))
        return self._end_of_press(history, deep)

    def _rest(
        self, core: _core.HyperelasticBody, centre: Array, normal: Array, deep: float, size: float, tip: Shape
    ) -> ContactHistory:
        """Press from one place of rest to the next, ten of them or four for each radius; refuse what does not rest."""
        parts = max(10, int(np.ceil(4.0 * deep / size)))
        depths = deep * np.arange(1, parts + 1) / parts

        def settle(part: int) -> Array:
            place = centre + (deep - depths[part]) * normal
            return np.asarray(core.settle(place[None], normal[None], size, tip == "flat", 200)[0])

        return _presses(press_to_rest(depths, settle)[None])

    def _end_of_press(self, history: ContactHistory, deep: float) -> Indentation:
        """Return the end of a press; warn if too few nodes carried it."""
        if deep > 0 and history.nodes[-1] == 0:
            warnings.warn(
                "the tip presses no node: the surface is fixed or not touchable there, the mesh is too coarse, or the "
                "contact was lost",
                BodyWarning,
                stacklevel=3,
            )
        elif deep > 0 and history.nodes[-1] < 4:
            warnings.warn(
                f"the tip presses {history.nodes[-1]} of the body's nodes, too few for a force to believe: take a "
                "finer mesh, a larger tip or a deeper press",
                BodyWarning,
                stacklevel=3,
            )
        return Indentation(history.force[-1], self.displacement())

    def _settle(self, centre: Array, size: float, normal: Array, tip: Shape, period: float) -> ContactHistory:
        """Hold the tip until the force stays within a thousandth for 50 ms; warn if it does not in 5 s."""
        hold = np.tile(centre, (int(np.ceil(0.05 / period)), 1))
        for _ in range(100):
            history = self.simulate_path(hold, size, outward=normal, tip=tip)
            if np.abs(np.ptp(history.force, axis=0)).max() <= 1e-3 * np.linalg.norm(history.force[-1]):
                break
        else:
            warnings.warn("the body did not come to rest in 5 s: give it damping", BodyWarning, stacklevel=3)
        return ContactHistory(
            history.force[-1:], history.deflection[-1:], history.energy[-1:], history.nodes[-1:], history.friction[-1:]
        )

    def simulate_path(
        self, path: ArrayLike, radius: float | str, *, outward: ArrayLike | None = None, tip: Shape = "sphere"
    ) -> ContactHistory:
        """Go one period for each place of the tip's centre in `path` (m, 3), m or text; the loop is the core's.

        `outward` (3,) or (m, 3) is the direction out of the body where it is pressed, and the axis of a flat end. If
        None, that of the nodes that a sphere presses, or of the nearest node; for a flat end the normal at the
        surface's nearest point. A tip may go in as deep as it likes, by less than its radius from place to place.
        """
        centres = np.ascontiguousarray(lengths(path, "path"))
        if centres.ndim != 2 or centres.shape[1] != 3:
            raise PoseError(f"a path is (m, 3) numbers in m; this has shape {centres.shape}")
        check_finite(centres, "path")
        size = positive(radius, "m", "radius")
        check_tip(tip)
        if outward is None and tip == "flat":
            corners = self.surface.vertices[self.surface.triangles[self.surface.nearest(centres)[1]]]
            outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        axes = np.empty((0, 3))
        if outward is not None:
            axes = directions(outward, centres.shape)
        rows = self.core.follow(centres, axes, size, tip == "flat")
        return _presses(rows)

    def pressure(self) -> Array:
        """Pressure of the tip on each node's patch (n,), Pa, in the last tick; the `indent` of `modal` makes none."""
        nodes, forces = self.core.pressed()
        found = np.zeros(len(self.nodes))
        found[nodes] = forces / self.contents.areas[nodes]
        return found

    def displacement(self) -> Array:
        """Mean displacement of each node's patch (n, 3), m, under the last tick's forces held for long.

        Of a lattice: where it is now; of a spline: that of the spline; under large displacements: at the last
        slow step.
        """
        if isinstance(self.core, _core.HyperelasticBody):
            return np.asarray(self.shares @ self.core.displacement())
        if isinstance(self.core, _core.MassSpringBody | _core.FreeFormBody):
            return np.asarray(self.core.displacement())
        nodes, forces = self.core.pressed()
        total = np.zeros(3 * len(self.nodes))
        for node, force, drag in zip(nodes, forces, self.core.dragged(), strict=True):
            total += self.compliance[:, 3 * node : 3 * node + 3] @ (drag - force * self.normals[node])
        return total.reshape(-1, 3)


def _presses(rows: Array) -> ContactHistory:
    """Return what the core's rows tell; BodyError if one of them was not solved."""
    if not rows[:, 9].all():
        raise BodyError("more than 128 nodes lie under the tip: take a smaller tip, or a coarser mesh")
    return ContactHistory(rows[:, 0:3], rows[:, 3:6], rows[:, 6], rows[:, 7].astype(np.int64), rows[:, 10:13])


def _damping(rayleigh_alpha: float | str, rayleigh_beta: float | str) -> tuple[float, float]:
    return not_negative(rayleigh_alpha, "1/s", "rayleigh_alpha"), not_negative(rayleigh_beta, "s", "rayleigh_beta")
