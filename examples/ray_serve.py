"""The service with replicas behind Ray Serve's proxy: `serve run examples.ray_serve:app`, in a checkout.

Needs `pip install . 'ray[serve]'`; LIGHTING_* settings count on every node.
"""

from ray import serve

from server.app import create_app


@serve.deployment(num_replicas=2, ray_actor_options={"num_cpus": 1})
@serve.ingress(create_app)
class Lighting:
    """One copy of the service, network and all."""


app = Lighting.bind()
