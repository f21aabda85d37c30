"""The layers that the networks are made of."""

import flax.linen as nn
import jax
import jax.numpy as jnp


class Dense(nn.Module):
    """A layer, in full float32 on every device.

    Its result has a column for each sample. CPUs are slow at the other layout's gradients with
    respect to the kernel, and at sums over a sample's few actions.
    """

    outputs: int
    scale: float
    initial_weights: str

    @nn.compact
    def __call__(self, x, axis):
        """Kernelᵀ x + bias, (outputs, samples), summed over the ``axis`` of x that holds inputs."""
        dtype, inputs = jnp.zeros(()).dtype, x.shape[axis]
        initial_kernel, initial_bias = self._initial(inputs)
        kernel = self.param("kernel", initial_kernel, (inputs, self.outputs), dtype)
        bias = self.param("bias", initial_bias, (self.outputs,), dtype)
        # Without the barrier, the transposition is moved past the product and its gradients.
        rows = jax.lax.optimization_barrier(kernel.T)
        product = jax.lax.dot_general(rows, x, (((1,), (axis,)), ((), ())), precision="highest")
        return product + bias[:, None]

    def _initial(self, inputs):
        if self.initial_weights == "orthogonal":
            return nn.initializers.orthogonal(self.scale), nn.initializers.zeros

        def uniform(key, shape, dtype):
            return jax.random.uniform(key, shape, dtype, -1.0, 1.0) / inputs**0.5

        return uniform, uniform


class MLP(nn.Module):
    """Multilayer perceptron with ReLU (Table 3)."""

    hidden_sizes: tuple[int, ...]
    outputs: int
    output_scale: float
    initial_weights: str = "orthogonal"

    @nn.compact
    def __call__(self, samples):
        """Map (samples, inputs) to (outputs, samples)."""
        x, axis = samples, 1
        for size in self.hidden_sizes:
            x, axis = nn.relu(Dense(size, 2**0.5, self.initial_weights)(x, axis)), 0
        return Dense(self.outputs, self.output_scale, self.initial_weights)(x, axis)
