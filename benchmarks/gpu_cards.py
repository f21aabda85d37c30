"""What XLA and a bound on the time have to know of a GPU, from its makers' data sheets."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Card:
    """A GPU.

    Attributes:
        name: as its makers have it.
        capability: compute capability, major and minor.
        cores: streaming multiprocessors.
        lanes: float32 lanes of each.
        clock_ghz: boosted.
        threads: most of a multiprocessor at one time.
        shared_kb: shared memory of a multiprocessor, and the most a block may ask for, KiB.
        l2_mb: second-level cache, MiB.
        bandwidth: of the memory, bytes/s.
        memory_gb: GiB.
    """

    name: str
    capability: tuple[int, int]
    cores: int
    lanes: int
    clock_ghz: float
    threads: int
    shared_kb: tuple[int, int]
    l2_mb: int
    bandwidth: float
    memory_gb: int

    @property
    def flops(self) -> float:
        """Most float32 operations/s, two of each lane in each cycle."""
        return 2 * self.cores * self.lanes * self.clock_ghz * 1e9

    @property
    def architecture(self) -> str:
        """As ptxas has it."""
        major, minor = self.capability
        return f"sm_{major}{minor}"

    @property
    def target(self) -> str:
        """XLA's description of it, for a compilation without one."""
        major, minor = self.capability
        shared, most_shared = self.shared_kb
        return f"""
            platform_name: "CUDA"
            device_description_str: "{self.name}"
            dnn_version_info {{ major: 9 minor: 10 }}
            gpu_device_info {{
              cuda_compute_capability {{ major: {major} minor: {minor} }}
              core_count: {self.cores}
              fpus_per_core: {self.lanes}
              clock_rate_ghz: {self.clock_ghz}
              memory_bandwidth: {self.bandwidth:.0f}
              device_memory_size: {self.memory_gb * 2**30}
              l2_cache_size: {self.l2_mb * 2**20}
              shared_memory_per_core: {shared * 2**10}
              shared_memory_per_block: {48 * 2**10}
              shared_memory_per_block_optin: {most_shared * 2**10}
              registers_per_core_limit: 65536
              registers_per_block_limit: 65536
              threads_per_core_limit: {self.threads}
              threads_per_block_limit: 1024
              threads_per_warp: 32
              block_dim_limit_x: 2147483647
              block_dim_limit_y: 65535
              block_dim_limit_z: 65535
            }}"""


CARDS = {
    "rtx-2070-super": Card(
        "NVIDIA GeForce RTX 2070 SUPER", (7, 5), 40, 64, 1.77, 1024, (64, 64), 4, 448e9, 8
    ),
    "rtx-4090": Card(
        "NVIDIA GeForce RTX 4090", (8, 9), 128, 128, 2.52, 1536, (100, 99), 72, 1008e9, 24
    ),
    "a100": Card("NVIDIA A100-SXM4-80GB", (8, 0), 108, 64, 1.41, 2048, (164, 163), 40, 2039e9, 80),
    "h100": Card("NVIDIA H100 80GB HBM3", (9, 0), 132, 128, 1.98, 2048, (228, 227), 50, 3352e9, 80),
}
"""GPUs by the names that gpu_program.py's --target knows."""
