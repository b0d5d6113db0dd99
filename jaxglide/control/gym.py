"""The environment for libraries of reinforcement learning: Gymnasium's interface.

Needs the extra `jaxglide[gym]`. Actions are -1 to 1 for the range of every input that is set;
observations are plain vectors (see `policy.observed`).
"""

from typing import Any, ClassVar

import equinox as eqx
import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_integer, check_kind
from .environment import Environment
from .plant import limits
from .policy import observed


class _Spaces:
    """What both kinds of environment have in common."""

    def __init__(self, environment: Environment, samples: int):
        check_kind("environment", environment, Environment)
        check_integer("samples", samples, 1, 100_000)
        self.environment, self.samples = environment, samples
        low, high = limits(environment.plant.drive, environment.chosen)
        index = np.array(environment.chosen)
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        count = len(index)
        self.action = gym.spaces.Box(-1.0, 1.0, (count,), np.float32)
        size = 8 + 2 * count
        self.observation = gym.spaces.Box(-np.inf, np.inf, (size,), np.float32)

        def reset(key):
            situation, sensed = environment.reset(key)
            return situation, observed(sensed, environment.chosen)

        def step(situation, action):
            wanted = self.middle + self.half * jnp.clip(action, -1.0, 1.0)
            moved = environment.step(situation, situation.plant.inputs.at[index].set(wanted))
            seen = observed(moved.sensed, environment.chosen)
            return moved.situation, (seen, moved.reward, moved.over, moved.landed)

        self.reset, self.step = reset, step


class GlideEnv(gym.Env):
    """One flight as a Gymnasium environment; `info["landed"]` says whether it has landed.

    Args:
        environment: what flies.
        samples: after which a flight is cut off.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(self, environment: Environment, samples: int = 200):
        self._spaces = _Spaces(environment, samples)
        self.action_space = self._spaces.action
        self.observation_space = self._spaces.observation
        self._reset = eqx.filter_jit(self._spaces.reset)
        self._step = eqx.filter_jit(self._spaces.step)
        self._situation = None

    def reset(self, *, seed: int | None = None, options=None):
        super().reset(seed=seed)
        key = jax.random.key(int(self.np_random.integers(2**31)))
        self._situation, seen = self._reset(key)
        return np.asarray(seen, np.float32), {}

    def step(self, action):
        if self._situation is None:
            raise RuntimeError("step before reset")
        self._situation, told = self._step(self._situation, jnp.asarray(action))
        seen, reward, over, landed = told
        cut = int(self._situation.sample) >= self._spaces.samples and not over
        info = {"landed": bool(landed)}
        return np.asarray(seen, np.float32), float(reward), bool(over), bool(cut), info


class GlideVectorEnv(gym.vector.VectorEnv):
    """Many flights at once, as one vmapped computation; one that is over begins anew at once.

    What is seen in the step that ends a flight is the launch of the next; the last of
    the old is `info["final_obs"]`, and whether it landed `info["final_info"]["landed"]`.

    Args:
        environment: what flies.
        num_envs: how many.
        samples: after which a flight is cut off.
    """

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": gym.vector.AutoresetMode.SAME_STEP}

    def __init__(self, environment: Environment, num_envs: int, samples: int = 200):
        check_integer("num_envs", num_envs, 1, 1_000_000)
        self._spaces = _Spaces(environment, samples)
        self.num_envs = num_envs
        self.single_action_space = self._spaces.action
        self.single_observation_space = self._spaces.observation
        self.action_space = gym.vector.utils.batch_space(self._spaces.action, num_envs)
        self.observation_space = gym.vector.utils.batch_space(
            self._spaces.observation, num_envs
        )
        self._reset = eqx.filter_jit(jax.vmap(self._spaces.reset))

        def step(situation, action, keys):
            """A step of each; what is over or cut off is drawn anew."""
            moved, told = jax.vmap(self._spaces.step)(situation, action)
            last, reward, over, landed = told
            begun, first = jax.vmap(self._spaces.reset)(keys)
            cut = (moved.sample >= samples) & ~over
            ended = over | cut

            def choose(new, old):
                if jnp.issubdtype(new.dtype, jax.dtypes.prng_key):
                    return jax.random.wrap_key_data(
                        choose(jax.random.key_data(new), jax.random.key_data(old))
                    )
                return jnp.where(ended.reshape(-1, *[1] * (new.ndim - 1)), new, old)

            arrays, rest = eqx.partition(begun, eqx.is_array)
            later = jax.tree.map(choose, arrays, eqx.filter(moved, eqx.is_array))
            seen = choose(first, last)
            return eqx.combine(later, rest), (seen, reward, over, cut, last, landed)

        self._step = eqx.filter_jit(step)
        self._situation = None

    def _keys(self):
        return jax.random.split(
            jax.random.key(int(self.np_random.integers(2**31))), self.num_envs
        )

    def reset(self, *, seed: int | None = None, options=None):
        super().reset(seed=seed)
        self._situation, seen = self._reset(self._keys())
        return np.asarray(seen, np.float32), {}

    def step(self, actions):
        if self._situation is None:
            raise RuntimeError("step before reset")
        self._situation, told = self._step(self._situation, jnp.asarray(actions), self._keys())
        seen, reward, over, cut, last, landed = map(np.asarray, told)
        ended, info = over | cut, {}
        if ended.any():
            final = {"landed": landed, "_landed": ended}
            info = {"final_obs": last.astype(np.float32), "final_info": final}
            info |= {f"_{name}": ended for name in info}
        return seen.astype(np.float32), reward, over, cut, info
