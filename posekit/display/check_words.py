"""Checks as people read them: spelled as the command line takes them."""


def check_words(reason: str) -> str:
    """Spell the check of a reason as `--checks` does: files say ``joint_range``, people read ``joint-range``.

    Parameters
    ----------
    reason : str
        A check, or ``check/where``, whose place stays as it is.

    Examples
    --------
    >>> check_words("joint_range/right_elbow.flexion")
    'joint-range/right_elbow.flexion'
    """
    check, slash, where = reason.partition("/")
    return check.replace("_", "-") + slash + where
