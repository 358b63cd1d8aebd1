"""A Ray cluster of two machines on this one; standard input says when the second is lost.

It prints the address of the cluster and the one for Ray's client, then "lost" once the processes of
the second machine have been killed. It ends with its standard input.
"""

from __future__ import annotations

import json
import socket
import sys

from ray.cluster_utils import Cluster

STORE = 80_000_000


def free_port() -> int:
    with socket.socket() as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def main() -> None:
    client = free_port()
    small = {"num_cpus": 1, "object_store_memory": STORE}
    head = {**small, "include_dashboard": False, "ray_client_server_port": client}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    second = cluster.add_node(**small)
    print(json.dumps([cluster.address, f"ray://127.0.0.1:{client}"]), flush=True)
    for _ in sys.stdin:
        cluster.remove_node(second, allow_graceful=False)
        print("lost", flush=True)
    cluster.shutdown()


if __name__ == "__main__":
    main()
