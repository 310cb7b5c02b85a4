"""Every system that is there, with what is known of it: the battery tests each by this list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from mlci.systems import DoubleIntegrator, Pendulum, System, TelescopingPendulum
from mlci.zoo.cart_pole import CartPole
from mlci.zoo.damped_spring import DampedSpring
from mlci.zoo.drag_mass import DragMass
from mlci.zoo.dubins_car import DubinsCar
from mlci.zoo.fuel_mass import FuelMass
from mlci.zoo.planar_point import PlanarPoint
from mlci.zoo.planar_quadrotor import PlanarQuadrotor
from mlci.zoo.unicycle import Unicycle
from mlci.zoo.van_der_pol import VanDerPol

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Listed:
    """A system and what is known of it.

    Attributes:
        system: as it is by default.
        config: its file in conf/system.
        kept: quantities (E, ...) of states (n, ...) that do not change under `free`.
        free: the control under which they do not.
        conservative: the system whose they are, where that is not the default.
        closed: where a constant control takes a state in a time, by a formula: from a start and a
            control, the state after `time`.
        start, control, time: for `closed`.
    """

    system: System
    config: str
    kept: Callable[..., np.ndarray] | None = None
    free: Vector | None = None
    conservative: System | None = None
    closed: Callable[[Vector, Vector, float], Vector] | None = None
    start: Vector = ()
    control: Vector = ()
    time: float = 1.3


def along_a_circle(speed: float, turn: float, start: Vector, time: float) -> Vector:
    """Where a wheel is that rolls at a speed and turns at a rate."""
    x, y, heading = start
    later, radius = heading + turn * time, speed / turn
    return (
        x + radius * (np.sin(later) - np.sin(heading)),
        y - radius * (np.cos(later) - np.cos(heading)),
        later,
    )


def under_drag(start: Vector, control: Vector, time: float) -> Vector:
    """x' = r tanh(s t), and its integral, from rest: r = sqrt(u / c), s = sqrt(u c)."""
    drag = DragMass().drag
    top, rate = np.sqrt(control[0] / drag), np.sqrt(control[0] * drag)
    return start[0] + np.log(np.cosh(rate * time)) / drag, top * np.tanh(rate * time)


def damped(start: Vector, control: Vector, time: float) -> Vector:
    """A linear system about the place at which the spring balances the control."""
    door = DampedSpring()
    rest = np.array([control[0] / door.stiffness, 0.0])
    drift = np.array([[0.0, 1.0], [-door.stiffness, -door.damping]])
    return tuple(rest + expm(drift * time) @ (np.array(start) - rest))


def cart_pole_motion(x, angle, speed, swing):
    """Energy of a pole's tip on a cart; at rest and upright it is m g l."""
    pole = CartPole()
    aside = speed + pole.length * np.cos(angle) * swing
    up = -pole.length * np.sin(angle) * swing
    height = pole.mass * pole.gravity * pole.length * np.cos(angle)
    momentum = speed + pole.mass * aside
    return np.array([speed**2 / 2 + pole.mass * (aside**2 + up**2) / 2 + height, momentum])


def quadrotor_motion(x, z, tilt, speed_x, speed_z, spin):
    """What a body keeps in free fall: energy, speed aside, spin."""
    return np.array([(speed_x**2 + speed_z**2) / 2 + 9.81 * z, speed_x, spin])


def mass_motion(start: Vector, control: Vector, time: float) -> Vector:
    """A parabola."""
    (x, speed), (u,) = start, control
    return x + speed * time + u * time**2 / 2, speed + u * time


# Of each a name, which tests show.
LISTED = {
    "pendulum": Listed(
        Pendulum(), "pendulum",
        lambda angle, speed: np.array([speed**2 / 2 + np.cos(angle)]), (0.0,),
    ),
    "telescope": Listed(
        TelescopingPendulum(), "telescope",
        lambda angle, spin, length, speed: np.array([spin**2 / 2 + 10 / length * np.cos(angle)])
        if np.ptp(length) < 1e-12 else np.array([speed * 0]), (0.0, 0.0),
    ),
    "mass": Listed(
        DoubleIntegrator(), "double_integrator", lambda x, speed: np.array([speed]), (0.0,),
        closed=mass_motion, start=(0.3, -1.0), control=(0.8,),
    ),
    "point": Listed(
        PlanarPoint(), "plane", lambda x, y: np.array([x, y]), (0.0, 0.0),
        closed=lambda start, control, time: tuple(np.array(start) + np.array(control) * time),
        start=(1.0, -2.0), control=(0.5, 1.5),
    ),
    "drag": Listed(
        DragMass(), "drag_mass", closed=under_drag, start=(-1.0, 0.0), control=(0.9,)
    ),
    "spring": Listed(
        DampedSpring(), "damped_spring",
        lambda x, speed: np.array([x**2 + speed**2]), (0.0,), DampedSpring(damping=1e-12),
        closed=damped, start=(0.8, -1.1), control=(2.5,),
    ),
    "van_der_pol": Listed(
        VanDerPol(), "van_der_pol",
        lambda x, speed: np.array([x**2 + speed**2]), (0.0,), VanDerPol(mu=1e-12),
    ),
    "unicycle": Listed(
        Unicycle(), "unicycle", lambda x, y, heading: np.array([x, y, heading]), (0.0, 0.0),
        closed=lambda start, u, time: along_a_circle(u[0], u[1], start, time),
        start=(0.4, -1.0, 2.0), control=(-0.7, 1.1),
    ),
    "dubins_car": Listed(
        DubinsCar(), "dubins_car",
        closed=lambda start, u, time: along_a_circle(DubinsCar().speed, u[0], start, time),
        start=(0.4, -1.0, 2.0), control=(1.1,),
    ),
    "fuel": Listed(
        FuelMass(), "fuel_mass", lambda x, speed: np.array([speed]), (0.0,),
        closed=mass_motion, start=(0.3, -1.0), control=(0.8,),
    ),
    "cart_pole": Listed(CartPole(), "cart_pole", cart_pole_motion, (0.0,)),
    "quadrotor": Listed(
        PlanarQuadrotor(), "planar_quadrotor", quadrotor_motion, (-9.81, 0.0),
        closed=lambda start, u, time: (  # upright, it climbs or sinks
            start[0], start[1] + start[4] * time + u[0] * time**2 / 2, 0.0,
            0.0, start[4] + u[0] * time, 0.0,
        ),
        start=(0.3, -0.5, 0.0, 0.0, 0.4, 0.0), control=(0.6, 0.0),
    ),
}  # fmt: skip
