"""A rolling tire as a chain of point masses in space: another road to the coupled ring's motion,
without modes and without small angles.

N nodes (complex s + i z) joined by stiff springs that may turn (bending), under inflation pressure
that follows them, each held by springs and dampers to its place on a hub that turns; road springs
where a node goes below the road. Velocity Verlet, no friction.
"""

import numpy as np


class NodeRing:
    def __init__(
        self, tire, load_N, speed_m_s, road, *, nodes=360, stretch_N=1e7, step_s=2e-6, height_m=None
    ):
        self.tire, self.load, self.road, self.step = tire, load_N, road, step_s
        self.rest = tire.R * np.exp(1j * (2.0 * np.pi * np.arange(nodes) / nodes - 0.5 * np.pi))
        self.length = abs(self.rest[1] - self.rest[0])
        self.corner = 2.0 * np.pi / nodes
        self.mass = 2.0 * np.pi * tire.R * tire.rho_A / nodes
        self.pitch = 2.0 * np.pi * tire.R / nodes
        self.spin = speed_m_s / tire.R
        self.stretch = stretch_N
        self.tension = tire.pb * tire.R + tire.rho_A * (tire.R * self.spin) ** 2
        self.hub = 1j * (tire.R if height_m is None else height_m)
        self.hub_rate = complex(-speed_m_s)
        self.angle = 0.0
        self.at = self.hub + self.rest
        self.rate = self.hub_rate + 1j * self.spin * self.rest
        self.held_s = True
        self.spindle = 0j
        self.forces = self._forces()

    def _forces(self):
        tire, at = self.tire, self.at
        along = np.roll(at, -1) - at
        long = np.abs(along)
        unit = along / long
        pull = (self.tension + self.stretch * (long / self.length - 1.0)) * unit
        force = pull - np.roll(pull, 1)
        bend = tire.EI / self.pitch * (np.angle(unit / np.roll(unit, 1)) - self.corner)
        across = (bend - np.roll(bend, -1)) * 1j * unit / long
        force = force + across - np.roll(across, 1)
        # pressure times half of the neighbouring segments, outward: -i times the direction of
        # growing angle
        force += -0.5j * tire.pb * (along + np.roll(along, 1))
        place = self.rest * np.exp(1j * self.angle)
        radial = place / tire.R
        arm = at - self.hub
        yielded = (arm - place) * radial.conj()
        moving = (self.rate - self.hub_rate - 1j * self.spin * arm) * radial.conj()
        hold = (tire.k_w * yielded.real + tire.c_w * moving.real) + 1j * (
            tire.k_v * yielded.imag + tire.c_v * moving.imag
        )
        hold = -self.pitch * hold * radial
        height, slope = self.road.profile(-at.real)
        depth = np.maximum(height - at.imag, 0.0)
        pressed = self.pitch * tire.k_t * depth * (slope + 1j)
        self.spindle = -hold.sum()
        torque = -(arm.conj() * hold).imag.sum()
        return force + hold + pressed, self.spindle - 1j * self.load, torque

    def run(self, duration_s, every):
        """(time, spindle) kept every so many steps."""
        kept, h = [], self.step
        for index in range(round(duration_s / h)):
            self._kick(0.5 * h)
            self.at = self.at + h * self.rate
            self.hub += h * self.hub_rate
            self.angle += h * self.spin
            self.forces = self._forces()
            self._kick(0.5 * h)
            if index % every == every - 1:
                kept.append((h * (index + 1), self.spindle))
        time, spindle = np.array(kept).T
        return time.real, spindle

    def _kick(self, h):
        nodes, hub, torque = self.forces
        self.rate = self.rate + h / self.mass * nodes
        self.hub_rate += 1j * h / self.tire.m_h * hub.imag
        self.spin += h / self.tire.J_h * torque
