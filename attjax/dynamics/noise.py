"""Standard normal numbers of every agent step, for a loop over components.

JAX's own generator is a loop over arrays, which each of its users repeats under ``vmap`` on CPU.
Here the same hash, Threefry-2x32, is written out for scalars, and two normal numbers are made of
its two words by the method of Box and Muller.
"""

import math
import zlib
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np

ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)
"""Of Threefry-2x32, bits: of every other four rounds."""

PARITY = np.uint32(0x1BD11BDA)
"""Of Threefry's key schedule."""


class Noise(NamedTuple):
    """Random numbers of one agent step, each by its name: none changes with what else is drawn.

    Attributes:
        key: two words of 32 bits.
        time: of the agent step, integer.
    """

    key: tuple[Any, Any]
    time: Any

    @classmethod
    def of(cls, key_data: chex.Array, time: chex.Numeric) -> "Noise":
        """Of a JAX key's data, whose first two words tell it from all others."""
        return cls((key_data[0], key_data[1]), jnp.asarray(time))

    def normal(self, name: str, count: int, dtype: chex.ArrayDType) -> tuple[Any, ...]:
        """So many standard normal numbers, up to 6.7 in size."""
        time = self.time.astype(jnp.uint32)
        blocks = [np.uint32(zlib.crc32(f"{name}.{n}".encode())) for n in range(-(-count // 2))]
        pairs = [_normals(threefry(self.key, (block, time)), dtype) for block in blocks]
        return tuple(x for pair in pairs for x in pair)[:count]


def threefry(key: tuple[Any, Any], counter: tuple[Any, Any]) -> tuple[Any, Any]:
    """Two random words of 32 bits, of two words of a key and two of a counter, unsigned."""
    keys = key[0], key[1], key[0] ^ key[1] ^ PARITY
    x, y = counter[0] + keys[0], counter[1] + keys[1]
    for n in range(5):
        for bits in ROTATIONS[n % 2]:
            x = x + y
            y = x ^ ((y << np.uint32(bits)) | (y >> np.uint32(32 - bits)))
        x = x + keys[(n + 1) % 3]
        y = y + keys[(n + 2) % 3] + np.uint32(n + 1)
    return x, y


def _normals(words, dtype):
    """Two standard normal numbers: a radius of one word, a direction of the other.

    Of the direction, 30 bits are an angle within 45° of the first axis, one exchanges the axes and
    one turns it round: so short a range needs no more than a few terms of sine and cosine.
    """
    first, second = words
    uniform = (first.astype(dtype) + 0.5) * 2.0**-32
    radius = jnp.sqrt(-2 * jnp.log(jnp.minimum(uniform, 1)))
    radius = jnp.where(second & np.uint32(2), -radius, radius)
    angle = jax.lax.bitcast_convert_type(second, jnp.int32).astype(dtype) * (math.pi / 2**33)
    square = angle * angle
    sine = angle * (1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72))))
    cosine = 1 - square / 2 * (
        1 - square / 12 * (1 - square / 30 * (1 - square / 56 * (1 - square / 90)))
    )
    is_exchanged = (second & np.uint32(1)) > 0
    one, other = jnp.where(is_exchanged, sine, cosine), jnp.where(is_exchanged, cosine, sine)
    return radius * one, radius * other
