"""The tire of the coupled ring's tests and benchmark: a passenger car's, at 1.2 bar on 0.14 m."""

from tirelog.physics.moving.ring import CoupledRing

TIRE = CoupledRing(
    EI=2.0,
    k_w=6.3e5,
    k_v=5.1e5,
    c_w=60.0,
    c_v=60.0,
    pb=1.2e5 * 0.14,
    R=0.3,
    k_t=8.75e7,
    rho_A=3.15,
    modes=40,
)
