//! Writing a recording's CSV file.

use std::io::{self, Write};

/// The columns of the file, all of equal length.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'c> {
    /// Time, s.
    pub t_s: &'c [f64],
    /// Position, mm.
    pub x_mm: &'c [f64],
    /// Velocity, mm/s; `None`: no such column.
    pub v_mm_s: Option<&'c [f64]>,
    /// Acceleration, m/s².
    pub a_m_s2: &'c [f64],
    /// Force that the probe applies to the target, N.
    pub f_n: &'c [f64],
}

/// Writes the header, one `#` line for each of its lines, the column names and the
/// rows. The number of decimals is fixed: 1 µs, 10 nm, 0.1 µm/s, 10 µm/s², 10 µN, each
/// far below the resolution of a probe, so the same columns give the same bytes on all
/// platforms.
///
/// # Errors
/// Errors of writing to `out`.
pub fn write(out: &mut impl Write, header: &str, columns: Columns<'_>) -> io::Result<()> {
    for line in header.lines() {
        writeln!(out, "# {line}")?;
    }
    match columns.v_mm_s {
        Some(_) => writeln!(out, "t_s,x_mm,v_mm_s,a_m_s2,f_n")?,
        None => writeln!(out, "t_s,x_mm,a_m_s2,f_n")?,
    }
    for (i, t_s) in columns.t_s.iter().enumerate() {
        write!(out, "{t_s:.6},{:.5},", columns.x_mm[i])?;
        if let Some(v_mm_s) = columns.v_mm_s {
            write!(out, "{:.4},", v_mm_s[i])?;
        }
        writeln!(out, "{:.5},{:.5}", columns.a_m_s2[i], columns.f_n[i])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_recording_is_read_back_with_its_header() {
        let (t_s, x_mm, a_m_s2, f_n) = (
            [0.0, 0.001, 0.002],
            [1.0, 2.5, -0.12345],
            [0.0, -9.81, 0.5],
            [1.0, 2.0, 3.0],
        );
        let v_mm_s = [1.5, -0.25, 1e3];
        let columns = Columns {
            t_s: &t_s,
            x_mm: &x_mm,
            v_mm_s: Some(&v_mm_s),
            a_m_s2: &a_m_s2,
            f_n: &f_n,
        };
        let mut bytes = Vec::new();
        write(&mut bytes, "a probe\n  indented = 1\n", columns).unwrap();
        let read = crate::recording::read("r", bytes.as_slice()).unwrap();
        assert_eq!(read.header, ["a probe", "  indented = 1"]);
        assert_eq!(read.t_s, t_s);
        assert_eq!(read.x_mm, x_mm);
        assert_eq!(read.v_mm_s, v_mm_s);
        assert_eq!(read.a_m_s2, a_m_s2);
        assert_eq!(read.f_n, f_n);
    }

    #[test]
    fn without_velocity_the_reader_computes_it() {
        let some = [0.0, 1.0, 2.0, 1.0];
        let columns = Columns {
            t_s: &[0.0, 1.0, 2.0, 3.0],
            x_mm: &some,
            v_mm_s: None,
            a_m_s2: &some,
            f_n: &some,
        };
        let mut bytes = Vec::new();
        write(&mut bytes, "", columns).unwrap();
        let read = crate::recording::read("r", bytes.as_slice()).unwrap();
        assert_eq!(read.v_mm_s, [1.0, 1.0, 0.0, -1.0]);
    }
}
