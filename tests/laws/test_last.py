"""What was made last is kept, and nothing else."""

from identifiability.foundation.values import remember


def test_the_last_few_are_made_once_and_the_oldest_goes():
    made, kept = [], {}

    def ask(key):
        return remember(kept, key, lambda: made.append(key) or f"of {key}", 2)

    assert [ask(key) for key in "abab"] == ["of a", "of b", "of a", "of b"]
    assert made == ["a", "b"]
    assert ask("c") == "of c"
    assert [*kept] == ["b", "c"]
    assert [ask("b"), ask("a")] == ["of b", "of a"]
    assert made == ["a", "b", "c", "a"]
