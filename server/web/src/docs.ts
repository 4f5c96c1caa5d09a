/** The reference of the HTTP API at /docs: Swagger UI over the service's own OpenAPI document. */

import "swagger-ui-dist/swagger-ui.css";
import "./style/docs.css";
import SwaggerUI from "swagger-ui-dist/swagger-ui-es-bundle.js";
import licences from "swagger-ui-dist/swagger-ui-es-bundle.js.LICENSE.txt?url";

document.querySelector<HTMLAnchorElement>("#licences")?.setAttribute("href", licences);

const dark = matchMedia("(prefers-color-scheme: dark)");
const applyScheme = () => document.documentElement.classList.toggle("dark-mode", dark.matches);
dark.addEventListener("change", applyScheme);
applyScheme();

SwaggerUI({
  dom_id: "#reference",
  url: "openapi.json",
  validatorUrl: null, // it would ask another host
  deepLinking: false, // its links would lie inside buttons
  defaultModelsExpandDepth: 0,
  tryItOutEnabled: true,
  onComplete: () => document.querySelector("#servers")?.setAttribute("aria-label", "Server"),
});
