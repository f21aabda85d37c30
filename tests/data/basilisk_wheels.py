"""Flies the LM50 bus on reaction wheels in Basilisk and prints what test_wheels.py compares with.

Needs the extra basilisk (bsk 2.12.1 wrote the file that is kept):

    PYTHONPATH=tests/helpers python tests/data/basilisk_wheels.py > tests/data/basilisk_wheels.csv

Columns: whether commands are held (else each is on for one RK4 step of the agent step's 21), the
action, counted as in Table 1, then Basilisk's modified Rodrigues parameters, angular velocity and
speeds of the wheels, rad/s, at the agent step's end. The first row of each flight is the start.

Basilisk counts whole nanoseconds, and 1/240 s is not one. So a second is longer there by SLOW, and
all that has a time in its unit is turned into that second and back.
"""

import numpy as np
from bodies import LM50

PERIOD = 4_166_667
"""Length of one RK4 step, ns."""

SLOW = PERIOD * 1e-9 * 240
FRAMESKIP, AGENT_STEPS = 20, 60
START = np.array([0.3, -0.4, 0.2, 0.15, -0.25, 0.3])  # MRP; rad/s
AXES = np.array([[0.8, 0.6, 0], [0, 0.8, 0.6], [0.6, 0, 0.8]])
LEVELS = (0.04, 0.02, 0.002)  # N m: above the motor's limit, within it, in its dead band
SPEEDS = np.array([30.0, -18.0, 12.0])  # rad/s; the first at its limit


def main():
    print("held,action,mrp_1,mrp_2,mrp_3,rate_1,rate_2,rate_3,speed_1,speed_2,speed_3")
    rng = np.random.default_rng(0)
    for held in (False, True):
        actions = rng.integers(0, 1 + 6 * len(LEVELS), AGENT_STEPS)
        states = [np.concatenate([START, SPEEDS]), *fly(actions, held)]
        for action, state in zip([0, *actions], states):
            print(int(held), action, *(f"{x:.17g}" for x in state), sep=",")


def motor_torques(action):
    """Of each wheel, N m, against the torque on the body that the action asks for."""
    torques = np.zeros(3)
    if action > 0:
        level, rest = divmod(action - 1, 6)
        torques[rest // 2] = (1 if rest % 2 else -1) * LEVELS[level]
    return torques


def fly(actions, held):
    """MRP, angular velocity and speeds (9,) after each agent step, by Basilisk's default, RK4."""
    from Basilisk.architecture import messaging
    from Basilisk.simulation import reactionWheelStateEffector, spacecraft
    from Basilisk.utilities import SimulationBaseClass

    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", PERIOD))
    craft = spacecraft.Spacecraft()
    wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
    craft.hub.mHub = 100.0  # kg; no force acts, so that any will do
    craft.hub.r_BcB_B = [[0.0]] * 3
    craft.hub.IHubPntBc_B = np.diag(LM50).tolist()
    craft.hub.sigma_BNInit = START[:3, None].tolist()
    craft.hub.omega_BN_BInit = (START[3:, None] / SLOW).tolist()
    for axis, speed in zip(AXES, SPEEDS):
        wheels.addReactionWheel(wheel(axis, speed))
    craft.addStateEffector(wheels)
    command = messaging.ArrayMotorTorqueMsg()
    wheels.rwMotorCmdInMsg.subscribeTo(command)
    simulation.AddModelToTask("task", wheels, 2)  # before the spacecraft moves on
    simulation.AddModelToTask("task", craft, 1)
    simulation.InitializeSimulation()
    ticks = 0
    for action in actions:
        torques = motor_torques(action)
        for applied, steps in ((torques, 1), (torques if held else 0 * torques, FRAMESKIP)):
            payload = messaging.ArrayMotorTorqueMsgPayload()
            payload.motorTorque = (applied / SLOW**2).tolist()
            command.write(payload)
            ticks += steps
            simulation.ConfigureStopTime(ticks * PERIOD)
            simulation.ExecuteSimulation()
        motion, speeds = craft.scStateOutMsg.read(), wheels.rwSpeedOutMsg.read().wheelSpeeds[:3]
        rates = SLOW * np.array([*motion.omega_BN_B, *speeds])
        yield np.array([*motion.sigma_BN, *rates])


def wheel(axis, speed):
    """A balanced one, as tests/envs/test_wheels.py describes it."""
    from Basilisk.simulation import reactionWheelStateEffector

    found = reactionWheelStateEffector.RWConfigPayload()
    found.gsHat_B = axis[:, None].tolist()
    found.RWModel = reactionWheelStateEffector.BalancedWheels
    found.Js = 2e-3
    found.u_max, found.u_min = 0.03 / SLOW**2, 0.004 / SLOW**2
    found.Omega, found.Omega_max = speed / SLOW, 30 / SLOW
    found.fCoulomb, found.cViscous = 5e-4 / SLOW**2, 2e-5 / SLOW
    found.betaStatic = -1  # no Stribeck friction
    return found


if __name__ == "__main__":
    main()
