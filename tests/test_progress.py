from attjax import progress


def test_plain_lines_where_there_is_no_terminal(capsys):
    row = {
        "agent_steps": 500_000, "episode_return": None, "success_rate": 0.5,
        "terminal_error_deg": 1.25,
    }  # fmt: skip
    with progress.ProgressLine(total_steps=1_000_000, done_steps=0) as line:
        line.show(row)
    output = capsys.readouterr().out
    assert "0.5/1M steps" in output and "return –" in output
    assert "success 50.0%" in output and "error 1.25°" in output and "ETA" in output
