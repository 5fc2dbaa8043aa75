//! After the stages: files, their verification, and the report.
