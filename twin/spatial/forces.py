"""Reads the forces on the spatial twin from MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Forces, Vector
from vvvaltr.twin.body import Body

if TYPE_CHECKING:
    import mujoco


def read_forces(model: mujoco.MjModel, data: mujoco.MjData, body: Body) -> Forces:
    """Return the forces on a body in newtons, from data on which ``mj_forward`` has run."""
    stretch_m = data.ten_length - model.tendon_lengthspring[:, 1]
    if body.tension_only:
        stretch_m = np.maximum(stretch_m, 0.0)
    tensions_n = model.tendon_stiffness * stretch_m + model.tendon_damping * data.ten_velocity
    frames = data.xmat[1:].reshape(-1, 3, 3)[[motor.strut for motor in body.motors]]
    along_strut_n = data.ctrl.reshape(-1, 3) * [1.0, 1.0, 0.0]  # the third control is a torque
    return Forces(
        tuple(tensions_n.tolist()),
        _vectors((frames @ along_strut_n[:, :, None])[:, :, 0]),
        _vectors(data.contact.pos),
        _vectors(_contacts_n(model, data)),
    )


def _contacts_n(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the ground's force at each contact in newtons, shape (contacts, 3)."""
    from mujoco import mj_contactForce

    forces_n, wrench = np.empty((data.ncon, 3)), np.empty(6)
    for contact, frame in enumerate(data.contact.frame.reshape(-1, 3, 3)):
        mj_contactForce(model, data, contact, wrench)
        forces_n[contact] = frame.T @ wrench[:3]
    return forces_n


def _vectors(rows: Array) -> tuple[Vector, ...]:
    return tuple((x, y, z) for x, y, z in rows.tolist())
