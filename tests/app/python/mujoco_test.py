"""A task of MuJoCo trains over the service: Gymnasium's InvertedPendulum-v5, with a reward of 1 for each of at most 1,000 steps."""

import unittest

import gymnasium
import numpy as np
from service_test import ServiceCase


class MujocoTest(ServiceCase):
    def test_an_inverted_pendulum_learns_to_stand(self):
        config = self.config(max_steps=60000, observation_size=4, action=3.0, gamma=0.99, reward_scale=1.0)
        _, returns = self.train(lambda: gymnasium.make("InvertedPendulum-v5"), config, 1500)
        print(f"stands for {returns} steps")
        self.assertGreater(np.mean(returns), 900.0, "a pendulum that nobody drives falls after about 30")


if __name__ == "__main__":
    unittest.main(verbosity=1)
