"""One spacecraft in Basilisk (https://avslab.github.io/basilisk), in a loop as RL needs it."""

import numpy as np
from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros
from single import FRAMESKIP, INERTIA, SingleSlew

from attjax.spacecraft import INTEGRATION_STEP

MASS = 100.0
"""kg; no force acts, so that any will do."""


class BasiliskSlew(SingleSlew):
    """Basilisk's rigid hub with an external torque, integrated by its default, RK4."""

    def __init__(self):
        self.simulation = SimulationBaseClass.SimBaseClass()
        self.period = macros.sec2nano(INTEGRATION_STEP)
        process = self.simulation.CreateNewProcess("process")
        process.addTask(self.simulation.CreateNewTask("task", self.period))
        self.hub = spacecraft.Spacecraft()
        self.hub.hub.mHub = MASS
        self.hub.hub.r_BcB_B = [[0.0], [0.0], [0.0]]
        self.hub.hub.IHubPntBc_B = np.diag(INERTIA).tolist()
        self.effector = extForceTorque.ExtForceTorque()
        self.hub.addDynamicEffector(self.effector)
        self.simulation.AddModelToTask("task", self.hub)
        self.simulation.AddModelToTask("task", self.effector)
        self.simulation.InitializeSimulation()
        self.attitude = self.hub.dynManager.getStateObject(self.hub.hub.nameOfHubSigma)
        self.spin = self.hub.dynManager.getStateObject(self.hub.hub.nameOfHubOmega)
        self.ticks = 0
        super().__init__()

    def _place(self, quaternion, angular_velocity):
        self.quaternion, self.angular_velocity = quaternion, angular_velocity
        self.attitude.setState((quaternion[:3] / (1 + quaternion[3]))[:, None].tolist())
        self.spin.setState(angular_velocity[:, None].tolist())

    def _propagate(self, torque):
        self._run(torque, 1)
        self._run(np.zeros(3), FRAMESKIP)
        message = self.hub.scStateOutMsg.read()
        self.quaternion = self._continued(np.array(message.sigma_BN))
        self.angular_velocity = np.array(message.omega_BN_B)

    def _run(self, torque, ticks):
        self.effector.extTorquePntB_B = torque[:, None].tolist()
        self.ticks += ticks
        self.simulation.ConfigureStopTime(self.ticks * self.period)
        self.simulation.ExecuteSimulation()

    def _continued(self, sigma):
        """The quaternion of modified Rodrigues parameters, with the sign that it had before."""
        square = sigma @ sigma
        quaternion = np.append(2 * sigma, 1 - square) / (1 + square)
        return -quaternion if quaternion @ self.quaternion < 0 else quaternion
