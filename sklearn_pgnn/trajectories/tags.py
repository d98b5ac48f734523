"""scikit-learn tags of estimators that read tables as records."""

from sklearn.utils import Tags


def tags_of_records(tags: Tags, has_time: bool = True) -> Tags:
    """Return a regressor's tags: states may be NaN, and random numbers follow no physical model.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> tags_of_records(Ridge().__sklearn_tags__()).input_tags.allow_nan
    True
    """
    tags.input_tags.allow_nan = has_time
    tags.regressor_tags.poor_score = has_time
    return tags
