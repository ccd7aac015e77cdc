"""The one exception for mistakes that a user can mend."""


class UserError(ValueError):
    """Bad input or configuration.

    The message names the field, the file and the remedy, and is shown without a traceback.
    """
