"""What is written about one attempt of a student, and what about all."""

from grader.review.model import Comment, ManualScore, StudentReview

SCORE = ManualScore(points=1.5, by="AB")
WHOLE, NEW = Comment(text="Nice", by="AB"), Comment(text="Better", by="AB")


def test_a_comment_on_one_attempt_takes_nothing_from_what_is_about_every_attempt() -> None:
    review = StudentReview(key="ana", manual={"readme": SCORE}, comments=(WHOLE,))
    for attempt in ("third", "second"):
        review = review.about(attempt, comments=(WHOLE, NEW))
        assert review.of("first").manual == {"readme": SCORE}
        assert review.of("first").comments == (WHOLE,)
        assert review.of(attempt).comments == (WHOLE, NEW)
    scored = review.about("first", manual={"readme": ManualScore(points=2, by="AB")})
    assert scored.of("first").manual["readme"].points == 2
    assert scored.of("third").manual == {"readme": SCORE}


def test_what_is_about_every_attempt_is_not_said_again_as_of_an_earlier_one() -> None:
    review = StudentReview(key="ana", comments=(WHOLE,)).about("first", comments=(WHOLE, NEW))
    (earlier,) = review.others_than(review.of("second"), ["first"])
    assert (earlier.attempt, earlier.comments) == ("first", (NEW,))
    removed = StudentReview(key="ana", comments=(WHOLE,)).about("second", comments=())
    assert not removed.others_than(removed.of("second"), ["first"])
