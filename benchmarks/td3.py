"""TD3 (Fujimoto et al. 2018) in PyTorch, on the Python package: what somebody writes who knows Gymnasium and nothing of Slalom.

learners.py trains with it beside Stable-Baselines3. Observations are [B, N] float32, actions [B, 2] in [-1, 1].
"""

import copy

import numpy as np
import torch
from torch import nn


def network(inputs, outputs):
    return nn.Sequential(nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs))


class Replay:
    """The last `capacity` transitions, in float32."""

    def __init__(self, capacity, num_observed, random):
        self.capacity, self.random, self.size, self.next = capacity, random, 0, 0
        self.rows = {name: np.zeros((capacity, width), np.float32) for name, width in
                     [("seen", num_observed), ("action", 2), ("reward", 1), ("then", num_observed), ("goes_on", 1)]}

    def add(self, **columns):
        at = (self.next + np.arange(len(columns["reward"]))) % self.capacity
        for name, rows in self.rows.items():
            rows[at] = columns[name].reshape(len(at), -1)
        self.next = (at[-1] + 1) % self.capacity
        self.size = min(self.size + len(at), self.capacity)

    def sample(self, batch_size):
        at = self.random.integers(0, self.size, batch_size)
        return [torch.from_numpy(rows[at]) for rows in self.rows.values()]


class TD3:
    def __init__(self, environments, seed, batch_size=256, gamma=0.99, tau=0.005, learning_rate=1e-3, noise=0.2, warmup=10_000):
        torch.manual_seed(seed)
        self.environments, self.batch_size, self.gamma, self.tau, self.noise, self.warmup = (
            environments, batch_size, gamma, tau, noise, warmup)
        self.random = np.random.default_rng(seed)
        num_observed = environments.single_observation_space.shape[0]
        self.replay = Replay(1_000_000, num_observed, self.random)
        self.actor = network(num_observed, 2)
        self.critics = nn.ModuleList(network(num_observed + 2, 1) for _ in range(2))
        self.targets = copy.deepcopy(nn.ModuleDict({"actor": self.actor, "critics": self.critics})).requires_grad_(False)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), learning_rate)
        self.critic_optimizer = torch.optim.Adam(self.critics.parameters(), learning_rate)
        self.seen, _ = environments.reset(seed=seed)
        self.num_steps = self.num_updates = 0

    @torch.no_grad()
    def act(self, observations):
        return torch.tanh(self.actor(torch.from_numpy(observations))).numpy()

    def step(self):
        """A step of each environment, and an update of the networks."""
        n = self.environments.num_envs
        if self.num_steps < self.warmup:
            actions = self.random.uniform(-1, 1, (n, 2)).astype(np.float32)
        else:
            noise = self.noise * self.random.standard_normal((n, 2), np.float32)
            actions = np.clip(self.act(self.seen) + noise, -1, 1)
        then, rewards, terminations, truncations, infos = self.environments.step(actions)
        last = then
        if "final_obs" in infos:  # Where an episode has ended, `then` begins the next one.
            last = np.where(infos["_final_obs"][:, None], infos["final_obs"], then)
        self.replay.add(seen=self.seen, action=actions, reward=rewards, then=last, goes_on=~terminations)
        self.seen = then
        self.num_steps += n
        if self.num_steps >= self.warmup:
            self.update()

    def update(self):
        seen, action, reward, then, goes_on = self.replay.sample(self.batch_size)
        with torch.no_grad():
            next_action = torch.tanh(self.targets["actor"](then))
            next_action = (next_action + (0.2 * torch.randn_like(action)).clamp(-0.5, 0.5)).clamp(-1, 1)
            both = torch.cat([then, next_action], 1)
            value = torch.min(*(critic(both) for critic in self.targets["critics"]))
            target = reward + self.gamma * goes_on * value
        both = torch.cat([seen, action], 1)
        loss = sum(nn.functional.mse_loss(critic(both), target) for critic in self.critics)
        self.critic_optimizer.zero_grad()
        loss.backward()
        self.critic_optimizer.step()
        self.num_updates += 1
        if self.num_updates % 2:
            return
        loss = -self.critics[0](torch.cat([seen, torch.tanh(self.actor(seen))], 1)).mean()
        self.actor_optimizer.zero_grad()
        loss.backward()
        self.actor_optimizer.step()
        with torch.no_grad():
            for name, ours in ("actor", self.actor), ("critics", self.critics):
                for slow, fast in zip(self.targets[name].parameters(), ours.parameters()):
                    slow.lerp_(fast, self.tau)
