"""Learners as earlier versions saved them: Adam's moments one vector a network."""

from collections.abc import Callable
from typing import Any

import jax
from jax.flatten_util import ravel_pytree

from attjax.ppo.train_state import Learner
from attjax.runs.folder import FolderError


def restored(restore: Callable[[Learner], Learner], template: Learner) -> Learner:
    """What ``restore`` makes of a template, whether this version saved it or an earlier one.

    Raises:
        FolderError: that of ``restore``, as it can read neither.
    """
    try:
        return restore(template)
    except FolderError as error:
        try:
            saved = restore(flat(template))
        except FolderError:
            raise error from None
        return _unflat(saved, template)


def flat(learner: Learner) -> Learner:
    """The same learner as an earlier version would have saved it."""
    return learner.replace(
        optimizer={
            name: _map_moments(lambda like: ravel_pytree(like)[0], network, learner.optimizer[name])
            for name, network in learner.params.items()
        }
    )


def _unflat(saved: Learner, template: Learner) -> Learner:
    """A saved learner whose moments are vectors, as they are kept now, in ``template``."""
    return saved.replace(
        optimizer={
            name: _map_moments(
                lambda like, vector: ravel_pytree(like)[1](vector),
                network,
                template.optimizer[name],
                saved.optimizer[name],
            )
            for name, network in template.params.items()
        }
    )


def _map_moments(function, network, state, *others):
    """An optimizer's state with ``function`` of all that has the structure of the network."""
    structure: Any = jax.tree.structure(network)

    def is_moments(x):
        return jax.tree.structure(x) == structure

    def mapped(like, *rest):
        return function(like, *rest) if is_moments(like) else (rest or (like,))[0]

    return jax.tree.map(mapped, state, *others, is_leaf=is_moments)
