"""Questions for oral exams, made by rules from what a submission's program is and did."""
